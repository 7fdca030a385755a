//! Pictures and report pages of a result directory, through the library and through the program.

use crate::fabricated;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use biotissue::app::report::picture::{PictureOptions, draw};
use biotissue::app::report::{ReportError, page};
use biotissue::app::results::{Collection, FieldSet, write_vtu};

const CELLS: [usize; 3] = [46, 8, 1];

fn results() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    fabricated::write(dir.path(), CELLS);
    dir
}

fn run(arguments: &[&str], dir: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_biotissue")).args(arguments).current_dir(dir).output().unwrap()
}

/// Checks that the text is well-formed XML: every element is closed in order, and attributes are quoted.
fn assert_well_formed(svg: &str) {
    let mut reader = quick_xml::Reader::from_str(svg);
    let mut depth = 0;
    loop {
        match reader.read_event().unwrap() {
            quick_xml::events::Event::Start(tag) => {
                tag.attributes().for_each(|attribute| drop(attribute.unwrap()));
                depth += 1;
            }
            quick_xml::events::Event::Empty(tag) => tag.attributes().for_each(|attribute| drop(attribute.unwrap())),
            quick_xml::events::Event::End(_) => depth -= 1,
            quick_xml::events::Event::Eof => break,
            _ => {}
        }
    }
    assert_eq!(depth, 0);
}

#[test]
fn the_picture_shows_the_body_its_fibers_and_a_legend() {
    let dir = results();
    let svg = draw(dir.path(), &PictureOptions::default()).unwrap();
    assert_well_formed(&svg);
    assert!(svg.len() < 600_000, "{} bytes", svg.len());
    for words in
        ["Dogbone in tension", "step 10", "extension 25.0\u{a0}%", "von Mises stress in kPa", "undeformed", "mm"]
    {
        assert!(svg.contains(words), "{words}");
    }
    // The visible faces: at least those of the top and of one long side, but not those behind.
    let [nx, ny, _] = CELLS;
    let faces = svg.matches("z\" fill=").count();
    assert!(faces >= 2 * nx * ny && faces < 4 * nx * ny, "{faces} faces");
    assert_eq!(svg, draw(dir.path(), &PictureOptions::default()).unwrap(), "the same results give the same picture");
}

#[test]
fn a_step_and_a_field_can_be_chosen() {
    let dir = results();
    let options = PictureOptions { step: Some(4), field: Some("network".into()), ..PictureOptions::default() };
    let svg = draw(dir.path(), &options).unwrap();
    assert!(svg.contains("step 4") && svg.contains("extension 10.0\u{a0}%") && svg.contains(">network<"));
    let missing = PictureOptions { step: Some(11), ..PictureOptions::default() };
    let error = draw(dir.path(), &missing).unwrap_err();
    assert!(matches!(&error, ReportError::NoStep(11, available) if available.len() == 10), "{error}");
    let missing = PictureOptions { field: Some("stress".into()), ..PictureOptions::default() };
    let error = draw(dir.path(), &missing).unwrap_err().to_string();
    assert!(
        error.contains("`stress`")
            && error.contains("von_mises_stress, fiber_alignment, ")
            && error.contains("cauchy_stress_xy"),
        "{error}"
    );
}

/// A state within a step that failed has no row of loads: its picture names no extension, and that of the page is the one
/// of the last step, with the sign that the fields of that step give.
#[test]
fn a_state_within_a_step_has_no_extension() {
    let dir = results();
    let file = dir.path().join("loads.csv");
    let loads = std::fs::read_to_string(&file).unwrap();
    let without_last: String = loads.lines().take(loads.lines().count() - 1).map(|line| format!("{line}\n")).collect();
    std::fs::write(&file, without_last).unwrap();
    let svg = draw(dir.path(), &PictureOptions::default()).unwrap();
    assert!(svg.contains("step 10") && !svg.contains("extension "), "{svg}");
    let html = page::page(dir.path(), &PictureOptions::default()).unwrap();
    assert!(html.contains("<dt>extension</dt><dd>22.5\u{a0}%</dd>"));
    let log = dir.path().join("log.jsonl");
    let resumed = std::fs::read_to_string(&log).unwrap().replace("\"resumed_from\":0", "\"resumed_from\":3");
    std::fs::write(&log, resumed).unwrap();
    let html = page::page(dir.path(), &PictureOptions::default()).unwrap();
    assert!(html.contains("10 load steps; 2\u{a0}min 07\u{a0}s of wall time since step 3."), "{}", &html[..200]);
}

#[test]
fn a_mesh_without_fields_is_drawn_in_one_color() {
    let dir = tempfile::tempdir().unwrap();
    let bar = fabricated::Bar::new([2, 2, 2]);
    let bare = FieldSet { points: &bar.points, elements: &bar.elements, ..FieldSet::default() };
    write_vtu(&dir.path().join("mesh.vtu"), &bare).unwrap();
    Collection::new(dir.path().join("fields.pvd")).add(0.0, "mesh.vtu").unwrap();
    let svg = draw(dir.path(), &PictureOptions::default()).unwrap();
    assert_well_formed(&svg);
    assert!(!svg.contains("fiber") && !svg.contains("step "));
    assert!(page::page(dir.path(), &PictureOptions::default()).unwrap().contains("<dt>elements</dt><dd>48</dd>"));
}

#[test]
fn the_page_is_complete_and_self_contained() {
    let dir = results();
    let html = page::page(dir.path(), &PictureOptions::default()).unwrap();
    for words in [
        "<h1>Dogbone in tension</h1>",
        "Converged: 10 load steps; 2\u{a0}min 07\u{a0}s",
        "Extension of the body and Newton iterations per load step",
        "Force on the body through each loaded surface against its extension",
        "Wall time by phase",
        "Micro-scale Newton iterations",
        "Pressure of each volume constraint",
        "element 17: det F = -0.2 &lt;= 0",
        "force x on right, N",
    ] {
        assert!(html.contains(words), "{words}");
    }
    assert!(!html.contains("force x on sides"), "a surface without load has no column");
    assert_eq!(html.matches("<svg xmlns").count(), 7);
    let tables: Vec<&str> = html.split("<table").collect();
    assert_eq!(
        tables[1..].iter().map(|table| table.matches("<tr>").count()).collect::<Vec<_>>(),
        [1 + 8, 1 + 10, 1 + 1]
    );
    assert!(tables[1].contains("<th>median</th>") && tables[1].contains("von Mises stress in kPa"), "{}", tables[1]);
    let outside = html.replace("http://www.w3.org/2000/svg", "").replace("http://www.w3.org/1999/xlink", "");
    for link in ["http:", "https:", "url(h", "url(/", "<script src", "<link", "@import", " src=", "fetch("] {
        assert!(!outside.contains(link), "{link}");
    }
}

/// Returns the numbers of the page in three dimensions.
fn viewer_data(html: &str) -> serde_json::Value {
    let (_, rest) = html.split_once("id=\"viewer-data\">").unwrap();
    serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
}

#[test]
fn the_page_holds_the_surface_and_the_values_of_all_steps() {
    let dir = results();
    let html = page::page(dir.path(), &PictureOptions { step: Some(4), ..PictureOptions::default() }).unwrap();
    let data = viewer_data(&html);
    let steps = data["steps"].as_array().unwrap();
    assert_eq!((steps.len(), &data["start"], &steps[3]["step"]), (10, &3.into(), &4.into()));
    let names: Vec<&str> =
        data["fields"].as_array().unwrap().iter().map(|field| field["name"].as_str().unwrap()).collect();
    let stresses = ["xx", "yy", "zz", "xy", "yz", "xz"].map(|part| format!("cauchy_stress_{part}"));
    assert_eq!(names[..2], ["von_mises_stress", "fiber_alignment"]);
    assert_eq!((&names[2..8], names[8]), (&stresses.each_ref().map(String::as_str)[..], "network"));
    // Twelve triangles for each cell on a side, less where sides meet: two for each face of a cell.
    let [nx, ny, nz] = CELLS;
    let triangles = 4 * (nx * ny + ny * nz + nz * nx);
    assert_eq!(data["triangles"].as_str().unwrap().len(), (12 * triangles).div_ceil(3) * 4);
    assert_eq!(data["tetrahedra"].as_str().unwrap().len(), (20 * 6 * nx * ny * nz).div_ceil(3) * 4);
    let values = |step: usize| steps[step]["values"][0]["high"][0].as_f64().unwrap();
    let range = &data["fields"][0]["range"];
    assert!(range[1].as_f64().unwrap() > 0.9 * values(9) && values(9) > values(0), "one range for all steps: {range}");
    assert!(html.contains("<noscript id=\"still\">") && !html.contains("Reduced surface"));
}

#[test]
fn view_and_range_are_options_and_the_canvas_fits_the_body() {
    let dir = tempfile::tempdir().unwrap();
    fabricated::write(dir.path(), [6, 6, 12]);
    let size = |svg: &str| -> [f64; 2] {
        ["width=\"", "height=\""]
            .map(|name| svg.split_once(name).unwrap().1.split_once('"').unwrap().0.parse().unwrap())
    };
    let along =
        |toward| draw(dir.path(), &PictureOptions { toward: Some(toward), ..PictureOptions::default() }).unwrap();
    let (side, end) = (along([0.0, -1.0, 0.0]), along([1.0, 0.0, 1.0]));
    assert_eq!((size(&side)[0], size(&end)[0]), (1200.0, 900.0), "the bar is narrow if it is seen from its end");
    let options = PictureOptions { range: Some([0.0, 2.0e6]), ..PictureOptions::default() };
    let svg = draw(dir.path(), &options).unwrap();
    assert!(svg.contains("von Mises stress in MPa") && svg.contains(">2.0<"), "the range is that of the option");
    let done = run(&["report", ".", "--picture", "a.svg", "--view", "-1,0,0", "--range", "-1e3,1e3"], dir.path());
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    for arguments in [["--view", "0,0,0"], ["--view", "1,2"], ["--range", "2,1"], ["--range", "a,b"]] {
        let failed = run(&["report", ".", arguments[0], arguments[1]], dir.path());
        assert_eq!(failed.status.code(), Some(2), "{arguments:?}");
    }
}

#[test]
fn missing_parts_are_left_out() {
    let pictures = |dir: &Path| page::page(dir, &PictureOptions::default()).unwrap().matches("<svg xmlns").count();
    let dir = results();
    fs::remove_file(dir.path().join("fields.pvd")).unwrap();
    assert_eq!(pictures(dir.path()), 6);
    let html = page::page(dir.path(), &PictureOptions::default()).unwrap();
    assert!(html.contains("extension in %"), "the log knows the distance of the surfaces");
    fs::remove_file(dir.path().join("log.jsonl")).unwrap();
    assert_eq!(pictures(dir.path()), 3);
    let html = page::page(dir.path(), &PictureOptions::default()).unwrap();
    assert!(html.contains("elongation in mm"), "without log and mesh the length of the body is not known");
    let dir = results();
    fs::remove_file(dir.path().join("loads.csv")).unwrap();
    assert_eq!(pictures(dir.path()), 5);
    let log = fs::read_to_string(dir.path().join("log.jsonl")).unwrap();
    let first = log.lines().next().unwrap();
    fs::write(dir.path().join("log.jsonl"), format!("{first}\n")).unwrap();
    let html = page::page(dir.path(), &PictureOptions::default()).unwrap();
    assert!(html.contains("0 load steps so far") && !html.contains("Load steps</h2>"));
}

#[test]
fn the_program_writes_page_and_picture() {
    let dir = results();
    let done = run(&["report", "."], dir.path());
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    assert!(dir.path().join("report.html").is_file());
    let done = run(&["report", ".", "--picture", "a.svg", "--step", "3", "--field", "fiber_alignment"], dir.path());
    assert_eq!((done.status.code(), done.stdout.as_slice()), (Some(0), &b"a.svg\n"[..]));
    assert!(fs::read_to_string(dir.path().join("a.svg")).unwrap().contains("step 3"));
}

#[test]
fn missing_and_damaged_results_are_reported() {
    let dir = tempfile::tempdir().unwrap();
    for (arguments, words) in
        [(&["report", "."][..], "is not a result directory"), (&["report", "nowhere"], "there is no such directory")]
    {
        let failed = run(arguments, dir.path());
        let message = String::from_utf8_lossy(&failed.stderr);
        assert_eq!(failed.status.code(), Some(2), "{message}");
        assert!(message.contains(words) && message.contains("expected:") && message.contains("cure:"), "{message}");
    }
    let dir = results();
    assert_eq!(run(&["report", ".", "--step", "99"], dir.path()).status.code(), Some(2));
    assert_eq!(run(&["report", ".", "-o", "no/such/folder.html"], dir.path()).status.code(), Some(4));
    fs::write(dir.path().join("fields-00010.vtu"), "<VTKFile>").unwrap();
    let failed = run(&["report", "."], dir.path());
    assert_eq!(failed.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&failed.stderr).contains("fields-00010.vtu"));
}

#[test]
fn names_are_escaped_in_page_and_picture() {
    let dir = results();
    let log = dir.path().join("log.jsonl");
    let text = fs::read_to_string(&log).unwrap().replace("Dogbone in tension", "<script>alert(1)</script> & \\\"x\\\"");
    fs::write(&log, text).unwrap();
    let html = page::page(dir.path(), &PictureOptions::default()).unwrap();
    assert!(!html.contains("<script>alert") && html.contains("&lt;script&gt;alert"));
    assert_well_formed(&draw(dir.path(), &PictureOptions::default()).unwrap());
}
