//! The files that `-o`, `--dump` and `--picture` name: links are followed, pipes are written to, and files beside a
//! network are not overwritten.

use std::path::Path;

use crate::{biotissue, frozen, line};

const GENERATE: &str = "network generate --points 12 --law linear --youngs-modulus 1e8 --radius 5e-8 -o";

fn read(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Returns the commands that write a file named by the user, without the name of the file.
#[cfg(unix)]
fn commands(folder: &Path) -> Vec<Vec<String>> {
    use crate::run::{PRESSED, run};

    run(folder, &PRESSED.replace("x = -1.5", "x = -0.5").replace("count = 5", "count = 1"), "").done();
    let split = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
    let network = frozen();
    let mut rve = split(&format!("rve {network} --json"));
    rve.extend(["--F", "1.01 0 0 0 1 0 0 0 1", "--dump"].map(str::to_owned));
    vec![
        split(GENERATE),
        split(&format!("network check {network} --clean -o")),
        rve,
        split("mesh box --cells 1,1,1 -o"),
        split("mesh box --cells 1,1,1 --binary -o"),
        split(&format!("network draw {network} -o")),
        split("report results -o"),
        split("report results --picture"),
    ]
}

#[cfg(unix)]
fn written(folder: &Path, command: &[String], name: &str) -> crate::Outcome {
    let mut arguments = command.to_vec();
    arguments.push(name.to_owned());
    biotissue(folder, &arguments)
}

#[test]
#[cfg(unix)]
fn pipes_and_devices_are_written_to() {
    use std::io::{Read as _, Write as _};
    use std::os::unix::fs::FileTypeExt as _;

    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe.svg");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    for command in commands(folder.path()) {
        // Open for reading and writing, so that this does not wait forever if a command replaces the pipe.
        let mut reader = std::fs::File::options().read(true).write(true).open(&pipe).unwrap();
        let (sent, received) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            let (mut all, mut some) = (Vec::new(), [0; 4096]);
            while !all.ends_with(b"THE END") {
                let count = reader.read(&mut some).unwrap();
                all.extend_from_slice(&some[..count]);
            }
            sent.send(all.len()).unwrap();
        });
        written(folder.path(), &command, "pipe.svg").done();
        let kind = std::fs::symlink_metadata(&pipe).unwrap().file_type();
        assert!(kind.is_fifo(), "{command:?} has replaced the pipe");
        std::fs::File::options().write(true).open(&pipe).unwrap().write_all(b"THE END").unwrap();
        let received = received.recv_timeout(std::time::Duration::from_secs(60)).unwrap();
        assert!(received > 100, "{command:?} has written {received} bytes");
        for beside in ["pipe.svg.toml", "pipe.svg.params"] {
            assert!(!folder.path().join(beside).exists(), "{command:?} {beside}");
        }
    }
    // The null device is tested last, after the commands have been shown to replace only regular files.
    for command in commands(folder.path()).iter().filter(|command| !command.contains(&"draw".to_owned())) {
        written(folder.path(), command, "/dev/null").done();
        assert!(std::fs::symlink_metadata("/dev/null").unwrap().file_type().is_char_device());
    }
}

#[test]
#[cfg(unix)]
fn the_target_of_a_link_is_written() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("deep")).unwrap();
    for (k, command) in commands(folder.path()).iter().enumerate() {
        let (target, link) = (format!("deep/target-{k}.svg"), format!("link-{k}.svg"));
        std::os::unix::fs::symlink(&target, folder.path().join(&link)).unwrap();
        for before in [None, Some("before")] {
            if let Some(text) = before {
                std::fs::write(folder.path().join(&target), text).unwrap();
            }
            written(folder.path(), command, &link).done();
            assert!(folder.path().join(&link).is_symlink(), "{command:?}");
            let target = folder.path().join(&target);
            assert!(!target.is_symlink() && std::fs::metadata(&target).unwrap().len() > 20, "{command:?}");
        }
    }
}

#[test]
fn files_beside_a_network_are_not_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let case = "title = \"mine\"\n";
    std::fs::write(folder.path().join("case.toml"), case).unwrap();
    let frozen = frozen();
    for command in [GENERATE, &format!("network check {frozen} --clean -o")] {
        let failed = line(folder.path(), &format!("{command} case"));
        let block = failed.failed(2);
        assert!(block.starts_with("error: case.toml: was not written with a network"), "{block}");
        assert_eq!(read(folder.path(), "case.toml"), case);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "a file was written");
    }
    // The same holds for laws that the user has given to a network.
    for (name, text) in [
        ("net.toml", "[law]\nname = \"linear\"\nyoungs_modulus = 1e6\nradius = 1e-7\n"),
        ("net.params", "1 2\n0 1e-7 1e6 1\n0\n0\n"),
    ] {
        std::fs::write(folder.path().join(name), text).unwrap();
        let failed = line(folder.path(), &format!("{GENERATE} net"));
        assert!(failed.failed(2).starts_with(&format!("error: {name}: was not written with ")), "{}", failed.stderr);
        assert_eq!(read(folder.path(), name), text);
        std::fs::remove_file(folder.path().join(name)).unwrap();
    }
    // Files written with a network are replaced with it, whatever its law; files that were changed since are not.
    line(folder.path(), &format!("{GENERATE} net")).done();
    assert!(folder.path().join("net.params").exists());
    line(folder.path(), &format!("network check {frozen} --clean -o net")).done();
    line(folder.path(), &format!("{GENERATE} net --seed 2")).done();
    line(folder.path(), "network info net").done();
    let (sidecar, params) = (read(folder.path(), "net.toml"), read(folder.path(), "net.params"));
    for (name, text) in [("net.toml", &sidecar), ("net.params", &params)] {
        std::fs::write(folder.path().join(name), text.replace("1e8", "1e7").replace("100000000", "10000000")).unwrap();
        assert_ne!(read(folder.path(), name), *text);
        assert!(line(folder.path(), &format!("{GENERATE} net")).failed(2).starts_with(&format!("error: {name}: ")));
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let soft = GENERATE.replace("linear", "exponential --nonlinearity 1.2");
    line(folder.path(), &format!("{soft} net")).done();
    assert!(!folder.path().join("net.params").exists(), "the .params format does not support the law");
    // Earlier versions wrote the sidecar without a checksum.
    line(folder.path(), &format!("{GENERATE} net")).done();
    let unsigned: String =
        sidecar.lines().filter(|line| !line.starts_with('#')).map(|line| format!("{line}\n")).collect();
    std::fs::write(folder.path().join("net.toml"), unsigned).unwrap();
    line(folder.path(), &format!("{GENERATE} net")).done();
}

#[test]
#[cfg(unix)]
fn a_link_to_a_network_with_its_own_laws_is_rejected() {
    let folder = tempfile::tempdir().unwrap();
    line(folder.path(), &format!("{GENERATE} net")).done();
    std::os::unix::fs::symlink("net", folder.path().join("link")).unwrap();
    let before = read(folder.path(), "net");
    let failed = line(folder.path(), &format!("{GENERATE} link --seed 3"));
    assert!(
        failed.failed(2).contains("net.toml: belongs to the network that is the target of the symbolic link"),
        "{}",
        failed.stderr
    );
    assert_eq!(read(folder.path(), "net"), before);
}
