//! The report page in a browser: headless Chromium turns the body, moves the slider, and reports pixels and console.
//!
//! Chromium speaks its DevTools protocol through two pipes, each message one JSON text that ends with a zero byte.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use biotissue::app::report::page;
use biotissue::app::report::picture::PictureOptions;
use biotissue::app::results::{Collection, NetworkSet, write_vtp};
use serde_json::{Value, json};

use crate::fabricated;
use crate::skip::skip;

/// The browser, with one page.
struct Browser {
    process: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    session: Option<String>,
    last_id: u64,
    /// Errors and warnings of the console.
    complaints: Vec<String>,
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Returns the browser of this machine: the one that `BIOTISSUE_CHROMIUM` names, or one with a usual name.
fn chromium() -> Option<PathBuf> {
    if let Some(named) = std::env::var_os("BIOTISSUE_CHROMIUM") {
        return Some(named.into());
    }
    let folders: Vec<PathBuf> = std::env::split_paths(&std::env::var_os("PATH")?).collect();
    let names = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
    names.iter().flat_map(|name| folders.iter().map(move |folder| folder.join(name))).find(|path| path.is_file())
}

impl Browser {
    /// Opens a file in a window of this size. `flags` are further options of the browser.
    fn open(page: &Path, profile: &Path, [width, height]: [u32; 2], flags: &[&str]) -> Option<Self> {
        let Some(program) = chromium() else {
            let is_required = std::env::var("BIOTISSUE_REQUIRE_BROWSER").is_ok_and(|value| value == "1");
            assert!(
                !is_required,
                "BIOTISSUE_REQUIRE_BROWSER is set, but there is no Chromium (BIOTISSUE_CHROMIUM names one)"
            );
            return None;
        };
        // The browser reads from file descriptor 3 and writes to 4.
        let script = "exec \"$@\" 3<&0 4>&1 </dev/null >/dev/null 2>/dev/null";
        let mut command = Command::new("bash");
        command.args(["-c", script, "chromium"]).arg(program);
        command.args(["--headless=new", "--no-sandbox", "--remote-debugging-pipe", "--no-first-run"]);
        command.args(["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]);
        command.arg(format!("--user-data-dir={}", profile.display())).arg(format!("--window-size={width},{height}"));
        let mut process =
            command.args(flags).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let (input, output) = (process.stdin.take().unwrap(), BufReader::new(process.stdout.take().unwrap()));
        let mut browser = Self { process, input, output, session: None, last_id: 0, complaints: Vec::new() };
        let target = browser.call("Target.createTarget", json!({ "url": "about:blank" }));
        let attached =
            browser.call("Target.attachToTarget", json!({ "targetId": target["targetId"], "flatten": true }));
        browser.session = Some(attached["sessionId"].as_str().unwrap().to_owned());
        for domain in ["Runtime.enable", "Log.enable", "Page.enable"] {
            browser.call(domain, json!({}));
        }
        browser.call("Page.navigate", json!({ "url": format!("file://{}", page.display()) }));
        let until = Instant::now() + Duration::from_secs(60);
        while browser.evaluate("document.readyState") != "complete" {
            assert!(Instant::now() < until, "the page does not load");
            std::thread::sleep(Duration::from_millis(50));
        }
        Some(browser)
    }

    /// Calls a method and returns its result.
    fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.last_id += 1;
        let mut message = json!({ "id": self.last_id, "method": method, "params": parameters });
        if let Some(session) = &self.session {
            message["sessionId"] = session.as_str().into();
        }
        self.input.write_all(format!("{message}\0").as_bytes()).unwrap();
        self.input.flush().unwrap();
        loop {
            let mut bytes = Vec::new();
            self.output.read_until(0, &mut bytes).unwrap();
            assert_eq!(bytes.pop(), Some(0), "the browser ended");
            let answer: Value = serde_json::from_slice(&bytes).unwrap();
            if answer["id"] == self.last_id {
                assert!(answer["error"].is_null(), "{method}: {answer}");
                return answer["result"].clone();
            }
            let kind = &answer["params"];
            match answer["method"].as_str() {
                Some("Runtime.exceptionThrown") => self.complaints.push(answer.to_string()),
                Some("Runtime.consoleAPICalled") if kind["type"] != "log" => self.complaints.push(answer.to_string()),
                Some("Log.entryAdded") if kind["entry"]["level"] != "info" => self.complaints.push(answer.to_string()),
                _ => {}
            }
        }
    }

    /// Returns the value of an expression of JavaScript.
    fn evaluate(&mut self, expression: &str) -> Value {
        let parameters = json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let result = self.call("Runtime.evaluate", parameters);
        assert!(result["exceptionDetails"].is_null(), "{expression}: {result}");
        result["result"]["value"].clone()
    }

    /// Returns a number that depends on all pixels of a canvas, and the share of pixels that are not of the background.
    fn pixels(&mut self, canvas: &str) -> (u64, f64) {
        self.pixels_between(canvas, [0.0, 1.0])
    }

    /// As [`Browser::pixels`], for the part of the width between two places from 0 to 1.
    fn pixels_between(&mut self, canvas: &str, [left, right]: [f64; 2]) -> (u64, f64) {
        let read = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => {
            const from = document.getElementById('CANVAS'), to = document.createElement('canvas');
            [to.width, to.height] = [from.width, from.height];
            const context = to.getContext('2d');
            context.drawImage(from, 0, 0);
            const [left, right] = [Math.round(LEFT * to.width), Math.round(RIGHT * to.width)];
            const p = context.getImageData(left, 0, right - left, to.height).data;
            let [sum, drawn] = [0, 0];
            for (let k = 0; k < p.length; k += 4) {
                sum = (sum * 31 + p[k] * 65536 + p[k + 1] * 256 + p[k + 2]) % 4294967291;
                drawn += p[k] !== p[0] || p[k + 1] !== p[1] || p[k + 2] !== p[2] ? 1 : 0;
            }
            done([sum, drawn / (p.length / 4)]);
        })))";
        let read =
            read.replace("CANVAS", canvas).replace("LEFT", &left.to_string()).replace("RIGHT", &right.to_string());
        let found = self.evaluate(&read);
        (found[0].as_u64().unwrap(), found[1].as_f64().unwrap())
    }

    fn mouse(&mut self, kind: &str, [x, y]: [f64; 2], buttons: u32) {
        let button = if kind == "mouseMoved" { "none" } else { "left" };
        let parameters = json!({ "type": kind, "x": x, "y": y, "button": button, "buttons": buttons, "clickCount": 1 });
        self.call("Input.dispatchMouseEvent", parameters);
    }

    fn wheel(&mut self, [x, y]: [f64; 2], delta: f64) {
        let parameters = json!({ "type": "mouseWheel", "x": x, "y": y, "deltaX": 0, "deltaY": delta });
        self.call("Input.dispatchMouseEvent", parameters);
    }

    /// Waits until an expression is true.
    fn wait_until(&mut self, expression: &str) {
        let until = Instant::now() + Duration::from_secs(30);
        while self.evaluate(expression) != true {
            assert!(Instant::now() < until, "{expression} does not become true");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    fn key(&mut self, key: &str) {
        self.call("Input.dispatchKeyEvent", json!({ "type": "keyDown", "key": key }));
        self.call("Input.dispatchKeyEvent", json!({ "type": "keyUp", "key": key }));
    }

    /// Returns the center of an element on the screen.
    fn center(&mut self, id: &str) -> [f64; 2] {
        let center = self.evaluate(&format!(
            "(() => {{ const b = document.getElementById('{id}').getBoundingClientRect();
               return [b.left + b.width / 2, b.top + b.height / 2]; }})()"
        ));
        [0, 1].map(|k| center[k].as_f64().unwrap())
    }
}

/// Writes results with two networks and their page; returns its path.
fn page_of_results(dir: &Path) -> PathBuf {
    fabricated::write(dir, [46, 8, 2]);
    let folder = dir.join("rve");
    std::fs::create_dir(&folder).unwrap();
    let corners: Vec<[f64; 3]> = (0..8).map(|k| [k & 1, k >> 1 & 1, k >> 2].map(|x| f64::from(x) - 0.5)).collect();
    let fibers: Vec<[u32; 2]> = (0..8).flat_map(|a| (0..a).map(move |b| [b, a])).collect();
    for element in ["element-00100", "element-00200"] {
        let mut collection = Collection::new(folder.join(format!("{element}.pvd")));
        for step in 1..=10 {
            let stretch = 1.0 + 0.05 * f64::from(step);
            let moved = |x: &[f64; 3]| [(stretch - 1.0) * x[0], 0.0, 0.0];
            let displacements: Vec<[f64; 3]> = corners.iter().map(moved).collect();
            let points: Vec<[f64; 3]> =
                corners.iter().zip(&displacements).map(|(x, u)| [x[0] + u[0], x[1], x[2]]).collect();
            let name = format!("{element}-step-{step:05}.vtp");
            let set = NetworkSet {
                points: &points,
                displacements: &displacements,
                fibers: &fibers,
                stretch: &vec![stretch; fibers.len()],
                force: &vec![0.0; fibers.len()],
                kind: &vec![0; fibers.len()],
            };
            write_vtp(&folder.join(&name), &set).unwrap();
            collection.add(f64::from(step) / 10.0, &name).unwrap();
        }
    }
    page::write(dir, None, &PictureOptions::default()).unwrap()
}

#[test]
fn a_browser_turns_the_body_and_moves_the_slider() {
    let dir = tempfile::tempdir().unwrap();
    let profile = tempfile::tempdir().unwrap();
    let page = page_of_results(dir.path()).canonicalize().unwrap();
    let Some(mut browser) = Browser::open(&page, profile.path(), [1400, 1000], &[]) else {
        return skip("needs Chromium (BIOTISSUE_CHROMIUM names one)");
    };
    assert_eq!(browser.evaluate("document.getElementById('body-viewer').hidden"), false);
    let (first, drawn) = browser.pixels("body");
    assert!((0.1..0.9).contains(&drawn), "{drawn} of the pixels are drawn");
    let (networks, drawn) = browser.pixels("networks");
    assert!(drawn > 0.005, "{drawn} of the pixels of the networks are drawn");

    // The pointer over the body shows a value.
    let [x, y] = browser.center("body");
    browser.mouse("mouseMoved", [x, y], 0);
    browser.pixels("body");
    let shown = browser.evaluate("document.getElementById('body-tip').textContent");
    assert!(shown.as_str().unwrap().contains("von Mises stress: "), "{shown}");

    browser.mouse("mousePressed", [x, y], 1);
    browser.mouse("mouseMoved", [x + 120.0, y + 60.0], 1);
    browser.mouse("mouseReleased", [x + 120.0, y + 60.0], 0);
    let (turned, drawn) = browser.pixels("body");
    assert!(turned != first && drawn > 0.05, "a turned body has other pixels");
    browser.key("0");
    assert_eq!(browser.pixels("body").0, first, "the key 0 restores the view");

    // The slider changes the shape of the body, its colors and the network, but not the range of the colors.
    let range = browser.evaluate("document.getElementById('high').value");
    browser.evaluate("document.getElementById('step').focus()");
    browser.key("Home");
    assert_eq!(browser.evaluate("document.getElementById('state').textContent"), "step 1, t = 0.100");
    assert_ne!(browser.pixels("body").0, first);
    assert_ne!(browser.pixels("networks").0, networks);
    assert_eq!(browser.evaluate("document.getElementById('high').value"), range);

    // Another field, and a clip.
    let before = browser.pixels("body").0;
    browser.evaluate("location.hash = 'step=10&field=fiber_alignment'");
    let colored = browser.pixels("body").0;
    assert!(colored != before && colored != first);
    browser.evaluate("location.hash = 'step=10&field=fiber_alignment&clip=0,0.5'");
    let (clipped, drawn) = browser.pixels("body");
    assert!(clipped != colored && drawn > 0.02, "{drawn}");
    assert!(browser.evaluate("window.biotissue.body.cut.elements.length").as_u64().unwrap() > 8, "the cut is closed");

    // Nothing is wider than a telephone.
    let narrow = json!({ "width": 400, "height": 900, "deviceScaleFactor": 1, "mobile": true });
    browser.call("Emulation.setDeviceMetricsOverride", narrow);
    let wide = browser.evaluate("document.documentElement.scrollWidth");
    assert!(wide.as_u64().unwrap() <= 400, "{wide} pixels");
    assert!(browser.pixels("body").1 > 0.02);
    assert!(browser.complaints.is_empty(), "{:#?}", browser.complaints);
}

#[test]
fn a_browser_zooms_plays_and_shows_numbers() {
    let dir = tempfile::tempdir().unwrap();
    let profile = tempfile::tempdir().unwrap();
    let page = page_of_results(dir.path()).canonicalize().unwrap();
    let Some(mut browser) = Browser::open(&page, profile.path(), [1400, 1000], &[]) else {
        return skip("needs Chromium (BIOTISSUE_CHROMIUM names one)");
    };
    let first = browser.pixels("body").0;

    // Keys and the wheel zoom, the wheel only once the canvas has the focus.
    let half = |browser: &mut Browser| browser.evaluate("window.biotissue.camera.half").as_f64().unwrap();
    let whole = half(&mut browser);
    let center = browser.center("body");
    browser.wheel(center, -300.0);
    browser.evaluate("scrollTo(0, 0)");
    assert_eq!(half(&mut browser), whole, "the wheel scrolls the page");
    browser.evaluate("document.getElementById('body').focus()");
    browser.key("+");
    let nearer = half(&mut browser);
    assert!((whole / nearer - 1.2).abs() < 1e-6, "{whole} {nearer}");
    assert_ne!(browser.pixels("body").0, first);
    browser.key("-");
    assert!((half(&mut browser) / whole - 1.0).abs() < 1e-6);
    let center = browser.center("body");
    browser.wheel(center, -300.0);
    browser.wait_until(&format!("window.biotissue.camera.half < {}", 0.9 * whole));
    browser.key("0");
    assert_eq!(browser.pixels("body").0, first);

    // The undeformed outline.
    browser.evaluate("document.getElementById('show-outline').click()");
    assert_ne!(browser.pixels("body").0, first);
    browser.evaluate("document.getElementById('show-outline').click()");
    assert_eq!(browser.pixels("body").0, first);

    // The stress of the middle at the last step is 1.9e4 (e^2 - 1) Pa, up to 15 %.
    let [x, y] = browser.center("body");
    browser.mouse("mouseMoved", [x, y], 0);
    browser.pixels("body");
    let shown = browser.evaluate("document.getElementById('body-tip').textContent");
    let words: Vec<&str> =
        shown.as_str().unwrap().split("von Mises stress: ").nth(1).unwrap().split_whitespace().collect();
    let value: f64 = words[0].parse().unwrap();
    assert!(words[1] == "kPa" && (value / (19.0 * 2.0_f64.exp_m1()) - 1.0).abs() < 0.15, "{shown}");
    browser.mouse("mouseMoved", [2.0, 2.0], 0);

    // The network before loading stays, the other one changes with the step.
    assert_eq!(browser.evaluate("document.getElementById('network-before').hidden"), false);
    let halves = |browser: &mut Browser| [[0.0, 0.5], [0.5, 1.0]].map(|half| browser.pixels_between("networks", half));
    let last = halves(&mut browser);
    assert!(last.iter().all(|(_, drawn)| *drawn > 0.005) && last[0].0 != last[1].0, "{last:?}");
    let longest = "Math.max(...window.biotissue.networks.networks.sides.map((side, k) => k === SIDE ? Math.max(...side.nodes) : 0))";
    let reach = |browser: &mut Browser, side: &str| browser.evaluate(&longest.replace("SIDE", side)).as_f64().unwrap();
    assert!((reach(&mut browser, "0") - 0.5).abs() < 1e-3 && (reach(&mut browser, "1") - 0.75).abs() < 1e-3);
    browser.evaluate("window.biotissue.setStep(0)");
    let early = halves(&mut browser);
    assert!(early[0] == last[0] && early[1] != last[1]);
    assert!((reach(&mut browser, "1") - 0.525).abs() < 1e-3);

    // Play takes all steps in order, and ends at the last one.
    browser.evaluate(
        "(() => { const report = window.biotissue, seen = window.seen = [];
           new MutationObserver(() => seen.push(report.body.step)).observe(document.getElementById('state'), { childList: true });
           document.getElementById('play').click(); })()",
    );
    assert_eq!(browser.evaluate("document.getElementById('play').textContent"), "Pause");
    browser.wait_until("document.getElementById('play').textContent === 'Play'");
    let seen = browser.evaluate("window.seen");
    assert_eq!(seen, json!([1, 2, 3, 4, 5, 6, 7, 8, 9]));
    assert_eq!(browser.evaluate("document.getElementById('state').textContent"), "step 10, t = 1.00");
    assert_eq!(browser.pixels("body").0, first);

    // Tables fit the page.
    let tables = browser.evaluate(
        "[...document.querySelectorAll('table')].map((table) =>
           [table.getBoundingClientRect().right, table.parentElement.scrollWidth - table.parentElement.clientWidth])",
    );
    let tables = tables.as_array().unwrap().clone();
    assert!(tables.len() > 1, "{tables:?}");
    for table in &tables {
        assert!(table[0].as_f64().unwrap() <= 1400.0 && table[1].as_f64().unwrap() <= 0.0, "{tables:?}");
    }
    assert!(browser.evaluate("document.documentElement.scrollWidth").as_u64().unwrap() <= 1400);
    assert!(browser.complaints.is_empty(), "{:#?}", browser.complaints);
}

/// A body of 504 000 tetrahedra opens with a reduced surface, and the page says so.
#[test]
fn half_a_million_elements_open() {
    let dir = tempfile::tempdir().unwrap();
    let profile = tempfile::tempdir().unwrap();
    let start = Instant::now();
    let elements = fabricated::write_large(dir.path(), [400, 70, 3]);
    assert!(elements >= 500_000);
    let written = start.elapsed();
    let page = page::write(dir.path(), None, &PictureOptions::default()).unwrap().canonicalize().unwrap();
    let made = start.elapsed() - written;
    let Some(mut browser) = Browser::open(&page, profile.path(), [1400, 1000], &[]) else {
        return skip("needs Chromium (BIOTISSUE_CHROMIUM names one)");
    };
    // The browser runs: what counts is the time of the page.
    let start = Instant::now();
    browser.call("Page.navigate", json!({ "url": format!("file://{}?again", page.display()) }));
    browser.wait_until(
        "document.readyState === 'complete' && (window.biotissue || {}).frames > 0 && location.search === '?again'",
    );
    let opened = start.elapsed();
    let (_, drawn) = browser.pixels("body");
    println!(
        "{elements} tetrahedra: results in {:.1} s, page of {:.1} MB in {:.1} s, opened in {:.1} s",
        written.as_secs_f64(),
        std::fs::metadata(&page).unwrap().len() as f64 * 1e-6,
        made.as_secs_f64(),
        opened.as_secs_f64()
    );
    assert!(drawn > 0.05, "{drawn}");
    // 5 s on a machine of its own; tests share one.
    assert!(opened < Duration::from_secs(20), "{opened:?}");
    let triangles = browser.evaluate("window.biotissue.body.triangles.length / 3").as_u64().unwrap();
    assert!((10_000..=60_000).contains(&triangles), "{triangles}");
    let text = browser.evaluate("document.body.innerText");
    let note = format!("Reduced surface: {triangles} of 117640 triangles.");
    assert!(text.as_str().unwrap().contains(&note), "{note}: {text}");
    assert!(browser.complaints.is_empty(), "{:#?}", browser.complaints);
}

#[test]
fn without_webgl_the_page_shows_the_picture() {
    let dir = tempfile::tempdir().unwrap();
    let profile = tempfile::tempdir().unwrap();
    let page = page_of_results(dir.path()).canonicalize().unwrap();
    let flags = ["--disable-gpu", "--disable-3d-apis"];
    let Some(mut browser) = Browser::open(&page, profile.path(), [1000, 800], &flags) else {
        return skip("needs Chromium (BIOTISSUE_CHROMIUM names one)");
    };
    assert_eq!(browser.evaluate("document.getElementById('body-viewer').hidden"), true);
    assert_eq!(browser.evaluate("document.querySelectorAll('figure.picture svg').length"), 1);
    assert!(browser.evaluate("document.querySelector('figure.picture svg').clientHeight").as_f64().unwrap() > 100.0);
}
