#[path = "../../../../tests/support/networks.rs"]
mod networks;

use std::path::{Path, PathBuf};

use self::networks::published_file;
use super::*;
use crate::fiber::law::{FiberMaterial, Law};
use crate::skip;

/// A valid network, of which each test changes one line: the corners and the center of a cube of edge 2, and the eight
/// fibers between them.
const GOOD: &str = "9 8 0\n0 0 0\n2 0 0\n0 2 0\n2 2 0\n0 0 2\n2 0 2\n0 2 2\n2 2 2\n1 1 1\n\
                    0 8\n1 8\n2 8\n3 8\n4 8\n5 8\n6 8\n7 8\n";
const GOOD_PARAMS: &str = "2 8\n0 5e-8 1e8 1000\n1 5e-8 1e8 1.2 1.4 1000\n0\n1\n0\n1\n0\n1\n0\n1\n";

fn frozen() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/networks/frozen.txt")
}

fn error_of(text: &str) -> String {
    match body::parse(Path::new("net.txt"), text.as_bytes()) {
        Ok(_) => format!("accepted: {text}"),
        Err(errors) => errors.to_string(),
    }
}

fn params_error_of(text: &str) -> String {
    match params::parse(Path::new("net.txt.params"), text.as_bytes(), 8) {
        Ok(_) => format!("accepted: {text}"),
        Err(errors) => errors.to_string(),
    }
}

// Expected contents and cures.
const COUNTED: &str = "one line for each counted item";
const CUT_SHORT: &str = "correct it; was the file cut short?";
const TOO_LONG: &str = "correct it; does the file have too many lines?";
const COMPARE: &str = "compare with the format of network files; was the file cut off or edited by hand?";
const FINITE: &str = "a finite number like 0.25 or -1e-3";
const PROGRAM: &str = "find the cause in the program that wrote the file";
const REAL: &str = "give the value of a real fiber";
const COUNTS: &str = "three counts: NODES FIBERS PERIODIC";
const NUMBERS: &str = "correct the number, or the counts in the first line";
const EQUAL_EDGES: &str = "edges that are equal within 1e-6 of the longest";
const CUBE: &str = "give a network that fills a cube; stretched boxes cannot be centered and scaled to the unit cube";

/// Checks the errors of texts. Cases: a text => position and description of its error, the expected content, the cure.
macro_rules! check_errors {
    ($error_of:ident, $file:literal; $($text:expr => $problem:literal, $expected:expr, $cure:expr;)*) => {$(
        let (text, problem) = ($text, concat!($file, $problem));
        let message = format!("{problem}\n  expected: {}\n  cure: {}", $expected, $cure);
        assert_eq!($error_of(&text), message, "for\n{text}");
    )*};
}

fn good_with(old: &str, new: &str) -> String {
    GOOD.replacen(old, new, 1)
}

fn params_with(old: &str, new: &str) -> String {
    GOOD_PARAMS.replacen(old, new, 1)
}

#[test]
fn error_messages_of_invalid_networks() {
    check_errors! { error_of, "net.txt";
        String::new() => ": the file is empty", COUNTS, COMPARE;
        good_with("9 8 0", "9 8") => ":1: there are 2 words on this line, `9 8`", COUNTS, COMPARE;
        good_with("9 8 0", "9 -8 0") => ":1: `-8` is not a count", "a nonnegative whole number", COMPARE;
        good_with("7 8\n", "") =>
            ":1: the header announces 9 nodes, 8 fibers and 0 periodic pairs, which is 17 lines, but 16 lines follow: \
             9 of three words or more and 7 of fewer",
            COUNTED, CUT_SHORT;
        format!("{GOOD}1 2\n") =>
            ":1: the header announces 9 nodes, 8 fibers and 0 periodic pairs, which is 17 lines, but 18 lines follow: \
             9 of three words or more and 9 of fewer",
            COUNTED, TOO_LONG;
        good_with("9 8 0", "18446744073709551615 18446744073709551615 18446744073709551615") =>
            ":1: the header announces 18446744073709551615 nodes, 18446744073709551615 fibers and \
             18446744073709551615 periodic pairs, which is 55340232221128654845 lines, but 17 lines follow: 9 of \
             three words or more and 8 of fewer",
            COUNTED, CUT_SHORT;
        good_with("9 8 0", "10 7 0") => ":11: there are 2 words on this line, `0 8`", "the position of a node: x y z",
            COMPARE;
        good_with("1 1 1", "1 l 1") => ":10: `l` is not a number", FINITE, COMPARE;
        good_with("1 1 1", "1 NaN 1") => ":10: `NaN` is not finite", FINITE, PROGRAM;
        good_with("1 1 1", "1 1 -inf") => ":10: `-inf` is not finite", FINITE, PROGRAM;
        good_with("1 1 1", "1e999 1 1") => ":10: `1e999` is not finite", FINITE, PROGRAM;
        good_with("1 1 1", "1 1 1 up") => ":10: `up` is not a number", FINITE, COMPARE;
        good_with("\n3 8", "\n3.5 8") => ":14: `3.5` is not a whole number", "a whole number like 12", COMPARE;
        good_with("\n3 8", "\n3 9") => ":14: there is no node 9", "nodes 0 to 8", NUMBERS;
        good_with("\n3 8", "\n-1 8") => ":14: there is no node -1", "nodes 0 to 8", NUMBERS;
        good_with("0 8\n1 8\n2 8\n3 8\n4 8\n5 8\n6 8\n7 8\n", "1 9\n2 9\n3 9\n4 9\n5 9\n6 9\n7 9\n8 9\n") =>
            ":11: node 9 of 9: the whole file counts its nodes from 1", "node numbers from 0",
            "subtract 1 from every node number of the fibers";
        good_with("\n3 8", "\n3 3") => ":14: fiber 3 runs from node 3 to itself", "two different nodes",
            "remove the fiber or correct it";
        good_with("1 1 1", "0 0 0") => ":11: fiber 0 between nodes 0 and 8 has the length 0e0, in cube edges",
            "a fiber of positive length", "merge the two nodes, lines 2 and 10, or move one";
        good_with("2 2 2", "2 2 0").replacen("1 1 1", "1 1 2", 1) =>
            ":9: nodes 3 and 7 have the same position, [2.0, 2.0, 0.0]", "a different position for every node",
            "merge the two, or move one; the other is on line 5";
        GOOD.replace('2', "2.001").replacen("0 2.001 0", "0 2 0", 1).replace("2.001 0 0", "2 0 0")
            .replace("2.001 8", "2 8").replace("2.001 2.001 0", "2 2.001 0")
            .replace("2.001 0 2.001", "2 0 2.001").replace("2.001 2.001 2.001", "2 2.001 2.001") =>
            ": the bounding box of the nodes has the edges 2 x 2.001 x 2.001, not a cube", EQUAL_EDGES, CUBE;
        "2 0 0\n0 0 0\n1 1 1\n".to_owned() => ":1: the network has no fibers", "at least one fiber",
            "generate the network again, with more points";
        "0 0 0\n".to_owned() => ": the bounding box of the nodes has the edges 0 x 0 x 0, not a cube",
            EQUAL_EDGES, CUBE;
        good_with("9 8 0", "9 8 1") + "0 3\n" => ":19: there is no node 0", "nodes 1 to 9", NUMBERS;
    }
}

#[test]
fn error_messages_of_invalid_params_files() {
    check_errors! { params_error_of, "net.txt.params";
        String::new() => ": the file is empty", "two counts: REACTIONS FIBERS", COMPARE;
        params_with("2 8", "2 7") => ":1: the parameters are for 7 fibers", "8 fibers, as the network has",
            "give the .params file of this network";
        params_with("2 8", "0 8") => ":1: there are 0 reactions", "from 1 to 65535 reactions", COMPARE;
        params_with("2 8", "99999999999 8") => ":1: there are 99999999999 reactions", "from 1 to 65535 reactions",
            COMPARE;
        params_with("2 8", "3 8") =>
            ":1: the header announces 3 reactions and 8 fibers, which is 11 lines, but 10 lines follow", COUNTED,
            CUT_SHORT;
        format!("{GOOD_PARAMS}0\n") =>
            ":1: the header announces 2 reactions and 8 fibers, which is 10 lines, but 11 lines follow", COUNTED,
            TOO_LONG;
        params_with("\n0 5e-8", "\n2 5e-8") => ":2: there is no reaction of type `2`",
            "`0 radius E density` (linear) or `1 radius E B lambda_t density` (exponential-stretch)",
            "give other laws in the case file or in the .toml file";
        params_with("0 5e-8 1e8 1000", "0 5e-8 1e8") => ":2: there are 3 words on this line, `0 5e-8 1e8`",
            "0 radius E density", COMPARE;
        params_with("0 5e-8", "0 0") => ":2: the radius is 0", "a radius above 0", REAL;
        params_with("1e8 1000", "-1 1000") => ":2: the modulus is -1", "a modulus above 0", REAL;
        params_with("1e8 1000", "1e8 -1000") => ":2: the density is -1000", "a density of at least 0", REAL;
        params_with("1.2 1.4", "0 1.4") => ":3: the nonlinearity B is 0", "a nonlinearity B above 0", REAL;
        params_with("1.2 1.4", "1.2 0.9") => ":3: the transition stretch is 0.9", "a stretch of at least 1",
            "give the stretch above which the law continues along its tangent line";
        params_with("\n0\n1\n", "\n0\n2\n") => ":5: there is no reaction 2", "reactions 0 to 1",
            "correct the number of this fiber's law";
    }
}

#[test]
fn all_errors_are_reported_up_to_a_maximum() {
    let broken = GOOD.replacen("1 1 1", "1 x 1", 1).replacen("\n3 8", "\n3 99", 1);
    let errors = body::parse(Path::new("net.txt"), broken.as_bytes()).unwrap_err();
    assert_eq!(errors.0.iter().map(|error| error.line).collect::<Vec<_>>(), [Some(10), Some(14)]);
    let unrecoverable = format!("1000 0 0\n{}", "a b c\n".repeat(1000));
    assert_eq!(body::parse(Path::new("net.txt"), unrecoverable.as_bytes()).unwrap_err().0.len(), 20);
}

#[test]
fn bytes_that_are_not_text_are_an_error_with_its_line() {
    let mut bytes = GOOD.as_bytes().to_vec();
    bytes[8] = 0xff;
    let errors = body::parse(Path::new("net.txt"), &bytes).unwrap_err();
    assert_eq!(errors.0[0].to_string().lines().next(), Some("net.txt:2: the byte 0xff is not text"));
}

#[test]
fn fibers_that_join_the_same_nodes_all_contribute_with_one_warning() {
    let once = GOOD.replacen("\n3 8", "\n8 2", 1);
    let body = body::parse(Path::new("net.txt"), once.as_bytes()).unwrap();
    assert_eq!((body.fibers.len(), body.fibers[3]), (8, [8, 2]));
    let warning = "1 fiber joins two nodes that another fiber already joins (this is the first); all contribute";
    assert_eq!(body.warnings, [format!("net.txt:14: {warning}")]);
    let twice = once.replacen("\n7 8", "\n2 8", 1);
    let body = body::parse(Path::new("net.txt"), twice.as_bytes()).unwrap();
    let warning = "2 fibers join two nodes that another fiber already joins (this is the first); all contribute";
    assert_eq!(body.warnings, [format!("net.txt:14: {warning}")]);
}

#[test]
fn a_byte_order_mark_is_skipped() {
    let body = body::parse(Path::new("net.txt"), format!("\u{feff}{GOOD}").as_bytes()).unwrap();
    assert_eq!(body.nodes.len(), 9);
    let params = params::parse(Path::new("net.txt.params"), format!("\u{feff}{GOOD_PARAMS}").as_bytes(), 8).unwrap();
    assert_eq!(params.materials.len(), 2);
}

#[test]
fn blank_lines_and_extra_numbers_are_ignored() {
    let text = GOOD.replacen("1 1 1", "\r\n\n  1 1 1 7 7\r", 1).replacen("\n3 8", "\n3 8 0", 1);
    let body = body::parse(Path::new("net.txt"), text.as_bytes()).unwrap();
    assert_eq!(body.nodes[8], [1.0; 3]);
    assert_eq!(body.fibers[3], [3, 8]);
    assert_eq!(body.warnings, ["net.txt:12: 2 lines have extra numbers (this is the first); they are ignored"]);
    let paired = GOOD.replacen("9 8 0", "9 8 1", 1) + "1 9\n";
    let body = body::parse(Path::new("net.txt"), paired.as_bytes()).unwrap();
    assert_eq!(body.periodic, [[0, 8]]);
    assert_eq!(body.warnings.len(), 1);
}

#[test]
fn a_network_is_read_with_the_materials_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("net.txt");
    std::fs::write(&path, GOOD).unwrap();
    let bare = read(&path).unwrap();
    assert_eq!(bare.network.name(), "net.txt");
    assert_eq!(bare.cube, Cube { lower: [0.0; 3], edges: [2.0; 3] });
    assert_eq!((bare.network.boundary().len(), bare.network.interior()), (8, &[8][..]));
    assert!(bare.network.materials().is_empty());
    std::fs::write(folder.path().join("net.txt.params"), GOOD_PARAMS).unwrap();
    let full = read(&path).unwrap();
    assert_eq!(full.network.material_of(), [0, 1, 0, 1, 0, 1, 0, 1]);
    let law = Law::ExponentialStretch { youngs_modulus: 1e8, nonlinearity: 1.2, transition: 1.4 };
    assert_eq!(full.network.materials()[1], FiberMaterial { law, radius: 5e-8, density: Some(1000.0) });
    // Writing and reading again gives the same materials.
    let copy = folder.path().join("copy.txt");
    write(&copy, &full.network).unwrap();
    write_params(&copy, &full.network).unwrap();
    let again = read(&copy).unwrap();
    assert_eq!(again.network.materials(), full.network.materials());
    assert_eq!(again.network.material_of(), full.network.material_of());
    assert_eq!(again.network.nodes(), full.network.nodes());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 4, "a temporary file was left behind");
}

#[cfg(feature = "app")]
#[test]
fn the_law_of_the_sidecar_is_used_only_without_a_params_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("net.txt");
    std::fs::write(&path, GOOD).unwrap();
    let law = Law::Exponential { youngs_modulus: 1e7, nonlinearity: 2.0 };
    let material = FiberMaterial { law, radius: 1e-7, density: None };
    sidecar::Sidecar { material: Some(material.clone()), ..Default::default() }.write_beside(&path).unwrap();
    assert_eq!(read(&path).unwrap().network.materials(), std::slice::from_ref(&material));
    std::fs::write(folder.path().join("net.txt.params"), GOOD_PARAMS).unwrap();
    let both = read(&path).unwrap();
    assert_eq!(both.network.materials().len(), 2);
    assert!(both.warnings[0].contains("its law differs"), "{:?}", both.warnings);
    assert!(write_params(&path, &Network::clone(&both.network).of_one_material(material)).is_err());
}

#[test]
fn coordinates_are_read_back_bitwise() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("net.txt");
    let mut nodes: Vec<[f64; 3]> = vec![[-0.5; 3], [0.5; 3]];
    for k in 1..200 {
        let x = f64::from(k);
        nodes.push([(x.sin() / 2.1), (x * 1.7).cos() / 2.1, 1e-9 * x.exp() % 0.49]);
    }
    let fibers: Vec<[u32; 2]> = (0..200).map(|k| [k, k + 1]).collect();
    let network = Network::new("net.txt", nodes, fibers).unwrap();
    write(&path, &network).unwrap();
    let again = read(&path).unwrap().network;
    for (a, b) in network.nodes().iter().flatten().zip(again.nodes().iter().flatten()) {
        assert_eq!(a.to_bits(), b.to_bits());
    }
    assert_eq!(network, again);
}

#[test]
fn the_frozen_network_is_unchanged() {
    let read = read(&frozen()).unwrap();
    let network = read.network;
    assert!(read.warnings.is_empty());
    assert_eq!((network.nodes().len(), network.fibers().len(), network.interior().len()), (127, 151, 12));
    assert_eq!(network.materials().len(), 1);
    #[cfg(feature = "generate")]
    {
        let generated = crate::fiber::network::generate::delaunay(12, 1).unwrap();
        assert_eq!((network.nodes(), network.fibers()), (generated.nodes(), generated.fibers()));
    }
}

/// Published networks are read from the folder in the environment variable `BIOTISSUE_NETWORKS`.
#[test]
fn nodes_of_published_networks_keep_their_positions() {
    let Some(path) = published_file("Network_2_7.txt") else { return };
    let network = read(&path).unwrap().network;
    assert_eq!((network.nodes().len(), network.fibers().len(), network.boundary().len()), (336, 635, 261));
    assert!((network.total_length() - 170.214164).abs() < 1e-6);
    let text = std::fs::read_to_string(&path).unwrap();
    for (line, node) in text.lines().skip(1).zip(network.nodes()) {
        let given: Vec<f64> = line.split_whitespace().map(|word| word.parse().unwrap()).collect();
        assert_eq!(given, node);
    }
    let report = crate::fiber::network::check::examine(&network);
    assert!((report.orientation[0][0] - 0.363266).abs() < 1e-6 && (report.orientation[0][1] + 0.001198).abs() < 1e-6);
    let Some(path) = published_file("del_4450seedL5_new_1.txt") else { return };
    let large = read(&path).unwrap();
    assert_eq!((large.network.nodes().len(), large.network.fibers().len()), (12_308, 38_376));
    assert_eq!(3 * large.network.interior().len(), 13_326);
    assert_eq!(large.cube, Cube { lower: [-2.5; 3], edges: [5.0; 3] });
}

/// All files of the folder `ligament` beside the published networks can be read: those of the current format with their
/// laws, and those of the older one.
#[test]
fn all_networks_of_the_published_ligament_are_read() {
    let Some(folder) = std::env::var_os("BIOTISSUE_NETWORKS").map(|folder| PathBuf::from(folder).join("ligament"))
    else {
        return skip::skip("BIOTISSUE_NETWORKS is not set");
    };
    let Ok(entries) = std::fs::read_dir(&folder) else {
        return skip::skip(&format!("there is no folder {}", folder.display()));
    };
    let paths = entries.map(|entry| entry.unwrap().path());
    let networks: Vec<PathBuf> = paths.filter(|path| path.extension().is_some_and(|end| end == "txt")).collect();
    assert!(!networks.is_empty(), "no networks in {}", folder.display());
    let refused: Vec<String> =
        networks.iter().filter_map(|path| read(path).err()).map(|error| error.to_string()).collect();
    assert!(refused.is_empty(), "{} of {} refused: {}", refused.len(), networks.len(), refused.join("\n"));
    for path in networks {
        let network = read(&path).unwrap().network;
        let cleaned = crate::fiber::network::check::clean(&network, None).unwrap();
        if !network.materials().is_empty() {
            assert_eq!(cleaned.kept_doubled_fibers, 0, "all fibers have one law: {}", path.display());
        }
    }
}
