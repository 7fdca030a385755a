//! Results are read back as they were written: field files by python-vtk and meshio, all files by this crate.

use biotissue::fem::mesh::Elements;
use std::path::Path;
use std::process::Command;

use biotissue::app::results::collection::{field_file, index_file};
use biotissue::app::results::log::{self, Cut, End, Migration, NewtonLog, Ranks, RveLog, Start, Step};
use biotissue::app::results::networks::{NetworkPoint, network_file};
use biotissue::app::results::{
    Collection, Event, FIELDS_FILE, FieldSet, Fields, LoadNames, LoadRow, Loads, LoadsWriter, LogWriter, NetworkSet,
    Networks, ResultsError, RigidRow, SurfaceRow, read_vtp, read_vtu, write_pieces, write_vtp, write_vtu,
};

use crate::skip::skip;

/// Fields on two tetrahedra with numbers that only a bitwise exact round trip preserves: numbers without a short
/// decimal form, extreme numbers, both zeros.
struct Sample {
    points: Vec<[f64; 3]>,
    elements: Elements,
    displacement: Vec<[f64; 3]>,
    energy: Vec<f64>,
    network: Vec<i64>,
    direction: Vec<[f64; 3]>,
    stress: Vec<[f64; 9]>,
}

impl Sample {
    fn new() -> Self {
        let third = 1.0 / 3.0;
        Self {
            points: vec![[0.0, -0.0, 0.0], [third, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 1e-300], [0.7, 0.7, 0.7]],
            elements: vec![[0, 1, 2, 3], [1, 2, 3, 4]].into(),
            displacement: (0..5).map(|k| [f64::from(k) * third, -f64::MIN_POSITIVE, 1e17 + f64::from(k)]).collect(),
            energy: vec![f64::EPSILON, f64::MAX],
            network: vec![-1, i64::MAX],
            direction: vec![[third, 2.0 * third, 2.0 * third], [0.0; 3]],
            stress: (0..2).map(|k| std::array::from_fn(|c| f64::from(10 * k + c as i32) / 7.0)).collect(),
        }
    }

    fn fields(&self) -> FieldSet<'_> {
        FieldSet {
            points: &self.points,
            elements: &self.elements,
            point_vectors: vec![("displacement", &self.displacement)],
            cell_scalars: vec![("energy_density", &self.energy)],
            cell_integers: vec![("network", &self.network)],
            cell_vectors: vec![("fiber_direction", &self.direction)],
            cell_tensors: vec![("cauchy_stress", &self.stress)],
            ..FieldSet::default()
        }
    }

    /// The lines that `read_vtu.py` must print for one reader.
    fn lines(&self, reader: &str) -> Vec<String> {
        let real = |values: &[f64]| values.iter().map(|v| hex(v.to_le_bytes())).collect::<Vec<_>>().join(" ");
        let whole = |values: &[i64]| values.iter().map(|v| hex(v.to_le_bytes())).collect::<Vec<_>>().join(" ");
        let elements: Vec<i64> = self.elements.iter().flatten().map(|&node| node.into()).collect();
        vec![
            format!("{reader} mesh points 3 {}", real(self.points.as_flattened())),
            format!("{reader} mesh elements 4 {}", whole(&elements)),
            format!("{reader} point displacement 3 {}", real(self.displacement.as_flattened())),
            format!("{reader} cell energy_density 1 {}", real(&self.energy)),
            format!("{reader} cell network 1 {}", whole(&self.network)),
            format!("{reader} cell fiber_direction 3 {}", real(self.direction.as_flattened())),
            format!("{reader} cell cauchy_stress 9 {}", real(self.stress.as_flattened())),
        ]
    }

    /// The line that `READ_CELLS` must print for one element.
    fn cell_line(&self, element: usize) -> String {
        let nodes: Vec<usize> = self.elements[element].iter().map(|&node| node as usize).collect();
        let mut values: Vec<[u8; 8]> = Vec::new();
        for field in [&self.points, &self.displacement] {
            values.extend(nodes.iter().flat_map(|&node| field[node].map(f64::to_le_bytes)));
        }
        values.push(self.energy[element].to_le_bytes());
        values.push(self.network[element].to_le_bytes());
        values.extend(self.direction[element].map(f64::to_le_bytes));
        values.extend(self.stress[element].map(f64::to_le_bytes));
        values.into_iter().map(hex).collect::<Vec<_>>().join(" ")
    }
}

fn hex(bytes: [u8; 8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Returns the output of `read_vtu.py` for a file; `None`, with the test recorded as skipped, if Python lacks the
/// readers.
fn read_by_python(path: &Path) -> Option<String> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/read_vtu.py");
    printed(Command::new("python3").arg(script).arg(path))
}

/// Prints one line per cell of a `.pvtu` file with every number bit for bit: the positions of its points, their
/// displacements, and the cell fields whose names follow the file in the arguments.
const READ_CELLS: &str = r#"
import struct, sys
try:
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLPUnstructuredGridReader
except ImportError:
    sys.exit(3)

reader = vtkXMLPUnstructuredGridReader()
reader.SetFileName(sys.argv[1])
reader.Update()
grid = reader.GetOutput()
points, cells = grid.GetNumberOfPoints(), grid.GetNumberOfCells()
rows = lambda array, count: vtk_to_numpy(array).reshape(count, -1).tolist()
positions = rows(grid.GetPoints().GetData(), points)
displacement = rows(grid.GetPointData().GetArray("displacement"), points)
fields = [rows(grid.GetCellData().GetArray(name), cells) for name in sys.argv[2:]]
for cell in range(cells):
    ids = grid.GetCell(cell).GetPointIds()
    nodes = [ids.GetId(k) for k in range(ids.GetNumberOfIds())]
    values = [value for field in (positions, displacement) for node in nodes for value in field[node]]
    values += [value for field in fields for value in field[cell]]
    print(" ".join(struct.pack("<d" if isinstance(value, float) else "<q", value).hex() for value in values))
"#;

/// Returns the output of a script; `None`, with the test recorded as skipped, if Python lacks the readers.
fn printed(script: &mut Command) -> Option<String> {
    let required = std::env::var("BIOTISSUE_REQUIRE_PYTHON").is_ok_and(|value| value == "1");
    let output = match script.output() {
        Ok(output) if output.status.code() != Some(3) => output,
        missing if required => panic!("python3 with meshio or vtk is required: {missing:?}"),
        _ => {
            skip("needs python3 with meshio or vtk");
            return None;
        }
    };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(String::from_utf8(output.stdout).unwrap())
}

/// Three fibers with numbers that only a bitwise exact round trip preserves.
const NETWORK: NetworkSet = NetworkSet {
    points: &[[-0.0, 1e-300, 0.5], [1.0 / 3.0, 0.1, -0.5], [0.7, f64::MIN_POSITIVE, 0.0], [0.25, 0.5, 2.0 / 7.0]],
    displacements: &[[0.0, -0.0, 1e-9], [0.1 / 3.0, 0.0, 0.0], [-1e-300, 0.2, 0.0], [0.0; 3]],
    fibers: &[[0, 1], [3, 1], [2, 0]],
    stretch: &[1.0 / 3.0, 1.0, 1.0 + f64::EPSILON],
    force: &[-1e-9 / 3.0, 0.0, f64::MAX],
    kind: &[0, 7, 1],
};

#[test]
fn networks_are_read_back_bit_for_bit() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(network_file(NetworkPoint { element: 12, point: None }, 7));
    assert!(path.ends_with("element-00012-step-00007.vtp"));
    write_vtp(&path, &NETWORK).unwrap();
    let read = read_vtp(&path).unwrap();
    let NetworkSet { points, displacements, fibers, stretch, force, kind } = NETWORK;
    assert_eq!(
        read,
        Networks {
            points: points.to_vec(),
            displacements: displacements.to_vec(),
            fibers: fibers.to_vec(),
            stretch: stretch.to_vec(),
            force: force.to_vec(),
            kind: kind.to_vec(),
        }
    );
    assert!(read.points[0][0].is_sign_negative());

    let whole = std::fs::read(&path).unwrap();
    let end = whole.windows(10).rposition(|tail| tail == b"</VTKFile>").unwrap();
    for cut in 0..end {
        std::fs::write(&path, &whole[..cut]).unwrap();
        assert!(read_vtp(&path).is_err(), "cut at {cut} of {}", whole.len());
    }
    write_vtu(&path, &Sample::new().fields()).unwrap();
    assert!(read_vtp(&path).unwrap_err().to_string().contains("the file holds the data set `UnstructuredGrid`"));
}

#[test]
fn networks_with_inconsistent_arrays_are_rejected() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("network.vtp");
    let error = write_vtp(&path, &NetworkSet { force: &[1.0], ..NETWORK }).unwrap_err();
    assert!(matches!(&error, ResultsError::Length { name, found: 1, expected: 3, .. } if name == "force"), "{error}");
    let error = write_vtp(&path, &NetworkSet { displacements: &[[0.0; 3]], ..NETWORK }).unwrap_err();
    assert!(matches!(&error, ResultsError::Length { found: 1, expected: 4, .. }), "{error}");
    let error = write_vtp(&path, &NetworkSet { fibers: &[[0, 1], [1, 4], [2, 0]], ..NETWORK }).unwrap_err();
    assert!(matches!(error, ResultsError::ElementNode { element: 1, node: 4, nodes: 4, .. }), "{error}");
    assert!(!path.exists());
}

#[test]
fn python_reads_every_number_of_a_network_file() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("network.vtp");
    write_vtp(&path, &NETWORK).unwrap();
    let Some(read) = read_by_python(&path) else { return };
    let real = |values: &[f64]| values.iter().map(|v| hex(v.to_le_bytes())).collect::<Vec<_>>().join(" ");
    let whole = |values: &[i64]| values.iter().map(|v| hex(v.to_le_bytes())).collect::<Vec<_>>().join(" ");
    let fibers: Vec<i64> = NETWORK.fibers.as_flattened().iter().map(|&node| node.into()).collect();
    let mut expected = [
        format!("vtk mesh points 3 {}", real(NETWORK.points.as_flattened())),
        format!("vtk mesh elements 2 {}", whole(&fibers)),
        format!("vtk point displacement 3 {}", real(NETWORK.displacements.as_flattened())),
        format!("vtk cell stretch 1 {}", real(NETWORK.stretch)),
        format!("vtk cell force 1 {}", real(NETWORK.force)),
        format!("vtk cell type 1 {}", whole(NETWORK.kind)),
    ];
    let mut found: Vec<&str> = read.lines().collect();
    found.sort_unstable();
    expected.sort_unstable();
    assert_eq!(found, expected);
}

#[test]
fn python_reads_every_number_of_a_field_file() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("fields-00001.vtu");
    let sample = Sample::new();
    write_vtu(&path, &sample.fields()).unwrap();

    let Some(read) = read_by_python(&path) else { return };
    let mut readers = 0;
    for reader in ["meshio", "vtk"] {
        let mut found: Vec<&str> = read.lines().filter(|line| line.split(' ').next() == Some(reader)).collect();
        if found.is_empty() {
            skip(&format!("needs {reader} of Python"));
            continue;
        }
        readers += 1;
        let mut expected = sample.lines(reader);
        found.sort_unstable();
        expected.sort_unstable();
        assert_eq!(found, expected);
    }
    assert!(readers > 0, "{read}");
}

#[test]
fn python_reads_the_parts_of_a_body_as_one_grid() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(index_file(3));
    let sample = Sample::new();
    // The second element is in part 0, the first element in part 2; part 1 has no element.
    write_pieces(&path, &sample.fields(), &[2, 0], 3).unwrap();
    let entries = std::fs::read_dir(dir.path()).unwrap();
    let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    assert_eq!(names, ["fields-00003-part-0000.vtu", "fields-00003-part-0002.vtu", "fields-00003.pvtu"]);

    let fields = ["energy_density", "network", "fiber_direction", "cauchy_stress"];
    let Some(read) = printed(Command::new("python3").args(["-c", READ_CELLS]).arg(&path).args(fields)) else { return };
    let found: Vec<&str> = read.lines().collect();
    assert_eq!(found, [sample.cell_line(1), sample.cell_line(0)], "part by part");
}

#[test]
fn fields_are_read_back_bit_for_bit() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("fields-00001.vtu");
    let sample = Sample::new();
    write_vtu(&path, &sample.fields()).unwrap();
    let read = read_vtu(&path).unwrap();
    let expected = Fields {
        points: sample.points.clone(),
        elements: sample.elements.clone(),
        point_vectors: vec![("displacement".into(), sample.displacement.clone())],
        cell_scalars: vec![("energy_density".into(), sample.energy.clone())],
        cell_integers: vec![("network".into(), sample.network.clone())],
        cell_vectors: vec![("fiber_direction".into(), sample.direction.clone())],
        cell_tensors: vec![("cauchy_stress".into(), sample.stress.clone())],
        ..Fields::default()
    };
    assert_eq!(read, expected);
    assert!(read.points[0][1].is_sign_negative());
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1, "a temporary file is left");
}

#[test]
fn fields_that_do_not_match_the_mesh_are_rejected_and_nothing_is_written() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("fields.vtu");
    let sample = Sample::new();
    let short = FieldSet { cell_scalars: vec![("energy_density", &sample.energy[..1])], ..sample.fields() };
    let error = write_vtu(&path, &short).unwrap_err();
    assert!(matches!(&error, ResultsError::Length { name, found: 1, expected: 2, .. } if name == "energy_density"));
    let elements = vec![[0, 1, 2, 3], [0, 1, 2, 5]].into();
    let dangling = FieldSet { elements: &elements, ..sample.fields() };
    let error = write_vtu(&path, &dangling).unwrap_err();
    assert!(matches!(error, ResultsError::ElementNode { element: 1, node: 5, nodes: 5, .. }), "{error}");
    assert!(!path.exists());
}

#[test]
fn a_damaged_field_file_is_an_error_wherever_it_is_cut() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("fields.vtu");
    write_vtu(&path, &Sample::new().fields()).unwrap();
    let whole = std::fs::read(&path).unwrap();
    let end = whole.windows(10).rposition(|tail| tail == b"</VTKFile>").unwrap();
    for cut in (0..end).step_by(37) {
        std::fs::write(&path, &whole[..cut]).unwrap();
        assert!(read_vtu(&path).is_err(), "cut at {cut} of {}", whole.len());
    }
    let text = String::from_utf8(whole).unwrap();
    let start = text.find("Name=\"types\"").unwrap();
    let (from, to) = (start + text[start..].find('>').unwrap() + 1, start + text[start..].find('<').unwrap());
    for array in ["", "AAAA", "AAAAAAAAAA=="] {
        std::fs::write(&path, format!("{}{array}{}", &text[..from], &text[to..])).unwrap();
        let error = read_vtu(&path).unwrap_err();
        assert!(error.to_string().contains("the array `types` ends after "), "{error}");
    }
}

#[test]
fn the_collection_is_complete_after_every_step() {
    let dir = tempfile::tempdir().unwrap();
    let pvd = dir.path().join(FIELDS_FILE);
    let mut collection = Collection::new(pvd.clone());
    for step in 1..=3 {
        collection.add(step as f64 / 3.0, &field_file(step)).unwrap();
        let read = Collection::read(pvd.clone()).unwrap();
        assert_eq!(read, collection);
        assert_eq!(read.entries().last().unwrap().step(), Some(step));
        assert_eq!(read.entries().last().unwrap().time, step as f64 / 3.0);
    }
    collection.add(2.0, "a & \"b\" <c>.vtu").unwrap();
    assert_eq!(Collection::read(pvd.clone()).unwrap(), collection);
    let resumed = Collection::resume(pvd.clone(), 2.0 / 3.0, &[]).unwrap();
    assert_eq!(resumed.entries().len(), 2);

    let text = std::fs::read_to_string(&pvd).unwrap();
    std::fs::write(&pvd, &text[..text.len() / 2]).unwrap();
    assert!(matches!(Collection::read(pvd.clone()), Err(ResultsError::Damaged { .. })));
    // Entries that the run is known to have written are restored.
    let restored = Collection::resume(pvd.clone(), 2.0 / 3.0, resumed.entries()).unwrap();
    assert_eq!((&restored, &Collection::read(pvd.clone()).unwrap()), (&resumed, &resumed));
}

fn loads_row(k: usize, step: usize, t: f64) -> LoadRow {
    let x = 0.1 * (k as f64 + 1.0);
    let surface = SurfaceRow { area: x, force: [x.exp(), -x, 1e-300], displacement: [x / 3.0, 0.0, -0.0] };
    let rigid = RigidRow { moment: [x.ln(), x, 0.0], rotation: [0.0, -x, 1e-9], displacement: [x.cos(), 0.0, 0.5] };
    LoadRow {
        step,
        t,
        surfaces: vec![surface, SurfaceRow::default()],
        points: vec![[x.sin(), 0.0, 1.0]],
        rigid: vec![rigid],
        volumes: vec![x.sqrt()],
        pressures: vec![-x.cbrt()],
    }
}

fn load_names(surfaces: &[&str], point: &str, rigid: &str, region: &str) -> LoadNames {
    LoadNames {
        surfaces: surfaces.iter().map(|name| name.to_string()).collect(),
        points: vec![point.into()],
        rigid: vec![rigid.into()],
        regions: vec![region.into()],
        constraints: vec![region.into()],
    }
}

#[test]
fn loads_with_unusual_names_are_read_back_exactly() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("loads.csv");
    let names = load_names(&["left, \"lower\"", "top.area"], "point0", "end.mx", "all.fx");
    let mut writer = LoadsWriter::create(&path, names.clone()).unwrap();
    for k in 0..3 {
        let row = loads_row(k, k + 1, k as f64 / 3.0);
        writer.row(&row).unwrap();
        let read = Loads::read(&path).unwrap();
        assert_eq!((read.rows.len(), &read.names, &read.rows[k]), (k + 1, &names, &row));
    }
    let mut reader = csv::Reader::from_path(&path).unwrap();
    let header: Vec<String> = reader.headers().unwrap().iter().skip(1).map(str::to_owned).collect();
    let records: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    let columns = Loads::read(&path).unwrap().columns();
    assert_eq!(columns.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>(), header);
    for (k, (name, values)) in columns.iter().enumerate() {
        let written: Vec<f64> = records.iter().map(|record| record[k + 1].parse().unwrap()).collect();
        assert_eq!(values, &written, "{name}");
    }
    let wrong = writer.row(&LoadRow { surfaces: vec![SurfaceRow::default()], ..LoadRow::default() }).unwrap_err();
    assert!(matches!(wrong, ResultsError::Length { found: 1, expected: 2, .. }));
}

#[test]
fn the_header_of_the_loads_is_unchanged() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("loads.csv");
    LoadsWriter::create(&path, load_names(&["x0"], "point0", "x1", "body")).unwrap();
    let header = "step,t,x0.area,x0.fx,x0.fy,x0.fz,x0.ux,x0.uy,x0.uz,point0.fx,point0.fy,point0.fz,\
                  x1.mx,x1.my,x1.mz,x1.rx,x1.ry,x1.rz,x1.dx,x1.dy,x1.dz,body.volume,body.pressure\n";
    assert_eq!(std::fs::read_to_string(&path).unwrap(), header);
    std::fs::write(&path, header.replace("x0.fz", "x0.fx")).unwrap();
    assert!(Loads::read(&path).unwrap_err().to_string().contains("loads.csv:1"));
}

#[test]
fn interrupted_loads_are_read_and_resumed() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("loads.csv");
    let names = load_names(&["a", "b"], "point0", "a", "body");
    let mut writer = LoadsWriter::create(&path, names.clone()).unwrap();
    for k in 0..3 {
        writer.row(&loads_row(k, k + 1, (k + 1) as f64 / 4.0)).unwrap();
    }
    let whole = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, &whole[..whole.len() - 3]).unwrap();
    assert_eq!(Loads::read(&path).unwrap().rows.len(), 2, "the last number lacks digits: its row must be ignored");

    let mut writer = LoadsWriter::resume(&path, names.clone(), 1).unwrap();
    writer.row(&loads_row(7, 2, 0.5)).unwrap();
    let steps: Vec<_> = Loads::read(&path).unwrap().rows.iter().map(|row| (row.step, row.t)).collect();
    assert_eq!(steps, [(1, 0.25), (2, 0.5)]);
    assert!(LoadsWriter::resume(&path, load_names(&["a"], "point0", "a", "body"), 1).is_err());
}

/// Rows after the last resumed step are dropped whatever they contain; up to there every row must be present once, in
/// order.
#[test]
fn loads_of_other_steps_are_not_resumed() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("loads.csv");
    let names = load_names(&["a", "b"], "point0", "a", "body");
    let mut writer = LoadsWriter::create(&path, names.clone()).unwrap();
    for k in 0..3 {
        writer.row(&loads_row(k, k + 1, (k + 1) as f64 / 4.0)).unwrap();
    }
    let whole = std::fs::read_to_string(&path).unwrap();
    let lines: Vec<&str> = whole.lines().collect();
    let resume = |lines: &[&str], done: usize| {
        std::fs::write(&path, lines.iter().map(|line| format!("{line}\n")).collect::<String>()).unwrap();
        LoadsWriter::resume(&path, names.clone(), done).map(|writer| writer.marks().len())
    };
    let [header, one, two, three] = lines[..] else { panic!("{lines:?}") };
    assert_eq!(resume(&lines, 3).unwrap(), 4);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), whole);
    assert_eq!(resume(&[header, one, two, "nonsense", three], 2).unwrap(), 3);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), [header, one, two, ""].join("\n"));
    for (lines, message) in [
        (&[header, one, three][..], "loads.csv:3: has load step 3 where step 2 belongs"),
        (&[header, one, one, two], "loads.csv:3: has load step 1 where step 2 belongs"),
        (&[header, two, one], "loads.csv:2: has load step 2 where step 1 belongs"),
        (&[header, one], "loads.csv:2: ends after load step 1"),
        (&[header], "loads.csv:1: ends after load step 0"),
    ] {
        let error = resume(lines, 2).unwrap_err().to_string();
        assert!(error.contains(message), "{error}");
    }
    std::fs::remove_file(&path).unwrap();
    let error = LoadsWriter::resume(&path, names.clone(), 2).unwrap_err().to_string();
    assert!(error.contains("loads.csv: is missing"), "{error}");
}

#[test]
fn the_log_is_read_back_and_survives_an_interruption() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("log.jsonl");
    let newton = NewtonLog { iterations: 2, residuals: vec![1.0, 0.1, 1e-9], ..NewtonLog::default() };
    let events = [
        Event::Start(Start { title: "a \"title\"\nof two lines".into(), rves: 8, ..Start::default() }),
        Event::Cut(Cut {
            step: 1,
            t: 1.0,
            reason: "diverged".into(),
            lost_rve: None,
            newton: newton.clone(),
            largest_residual: None,
        }),
        Event::Step(Step {
            step: 1,
            t: 0.5,
            cuts: 1,
            newton: newton.clone(),
            rve: Some(RveLog::default()),
            ..Step::default()
        }),
        Event::Step(Step { step: 1, t: 1.0, cuts: 1, newton, rve: None, ..Step::default() }),
        Event::End(End { converged: false, reason: Some("no more cuts".into()), steps: 1, seconds: 0.1 + 0.2 }),
    ];
    let mut writer = LogWriter::create(&path).unwrap();
    for (k, event) in events.iter().enumerate() {
        writer.write(event).unwrap();
        assert_eq!(log::read(&path).unwrap(), events[..=k]);
    }
    let whole = std::fs::read_to_string(&path).unwrap();
    assert!(whole.lines().all(|line| line.starts_with("{\"event\":\"")));

    std::fs::write(&path, format!("{}{{\"event\":\"later\",\"x\":1}}\n{{\"event\":\"st", &whole)).unwrap();
    let mut writer = LogWriter::resume(&path, 1).unwrap();
    writer.write(&events[0]).unwrap();
    let read = log::read(&path).unwrap();
    assert_eq!((&read[..5], &read[5], &read[6]), (&events[..], &Event::Unknown, &events[0]));

    std::fs::write(&path, format!("{whole}nonsense\n")).unwrap();
    assert!(log::read(&path).unwrap_err().to_string().contains("log.jsonl:6"));
}

/// A resumed run repeats the steps after its checkpoint with all that belongs to them.
#[test]
fn a_resumed_log_loses_all_events_of_the_steps_that_are_repeated() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("log.jsonl");
    let of_step = |step: usize| {
        [
            Event::Migration(Migration { step, ..Migration::default() }),
            Event::Ranks(Ranks { step, ..Ranks::default() }),
            Event::Step(Step { step, ..Step::default() }),
        ]
    };
    let mut writer = LogWriter::create(&path).unwrap();
    for event in (1..=3).flat_map(of_step) {
        writer.write(&event).unwrap();
    }
    LogWriter::resume(&path, 2).unwrap();
    assert_eq!(log::read(&path).unwrap(), (1..=2).flat_map(of_step).collect::<Vec<_>>());
}

#[test]
fn residuals_that_are_not_finite_are_read_as_nan() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("log.jsonl");
    let newton =
        NewtonLog { residuals: vec![1.0, f64::NAN], relative: vec![1.0, f64::INFINITY], ..NewtonLog::default() };
    LogWriter::create(&path).unwrap().write(&Event::Cut(Cut { newton, ..Cut::default() })).unwrap();
    let Event::Cut(cut) = &log::read(&path).unwrap()[0] else { panic!("another event") };
    assert!(cut.newton.residuals[0] == 1.0 && cut.newton.residuals[1].is_nan() && cut.newton.relative[1].is_nan());
}
