//! Writes a result directory with artificial but plausible values: a flat bar with a narrow middle part is pulled along
//! x, and its fibers rotate toward x; the grips at both ends have no fibers.

use biotissue::fem::mesh::Elements;
use std::path::Path;

use biotissue::app::results::collection::field_file;
use biotissue::app::results::log::{
    Cut, End, Factorizations, NewtonLog, NewtonSeconds, RveLog, Start, Step, SurfacePlace,
};
use biotissue::app::results::{
    Collection, Event, FIELDS_FILE, FieldSet, LOADS_FILE, LOG_FILE, LoadNames, LoadRow, LoadsWriter, LogWriter,
    SurfaceRow, write_vtu,
};

/// Length of the bar, m.
const LENGTH: f64 = 0.060;
const STEPS: usize = 10;

/// The mesh of the bar: cells divided into six tetrahedra each.
pub struct Bar {
    pub points: Vec<[f64; 3]>,
    pub elements: Elements,
}

impl Bar {
    pub fn new([nx, ny, nz]: [usize; 3]) -> Self {
        let fraction = |i: usize, n: usize| i as f64 / n as f64;
        let mut points = Vec::new();
        for k in 0..=nz {
            for j in 0..=ny {
                for i in 0..=nx {
                    let x = fraction(i, nx);
                    let width = 0.007 + 0.007 * smooth((2.0 * (x - 0.5).abs() - 0.45) / 0.25);
                    points.push([LENGTH * x, width * (fraction(j, ny) - 0.5), 0.003 * fraction(k, nz)]);
                }
            }
        }
        let node = |i: usize, j: usize, k: usize| (i + (nx + 1) * (j + (ny + 1) * k)) as u32;
        let mut elements = Vec::new();
        for (i, j, k) in (0..nx * ny * nz).map(|c| (c % nx, c / nx % ny, c / nx / ny)) {
            let corner = |c: usize| node(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2));
            for tet in [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]] {
                elements.push(tet.map(corner));
            }
        }
        Self { points, elements: elements.into() }
    }

    fn center(&self, element: usize) -> [f64; 3] {
        let nodes: Vec<[f64; 3]> = self.elements[element].iter().map(|&node| self.points[node as usize]).collect();
        std::array::from_fn(|axis| nodes.iter().map(|node| node[axis]).sum::<f64>() / 4.0)
    }
}

/// Returns the smooth step function, which rises from 0 to 1 between `x = 0` and `x = 1`.
fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// Returns a pseudo-random number in `[0, 1)`.
fn noise(seed: usize) -> f64 {
    let x = (seed as f64 * 12.9898).sin() * 43758.5453;
    x - x.floor()
}

/// Returns the fraction of the elongation that occurs left of x.
fn elongation(x: f64) -> f64 {
    let s = x / LENGTH;
    0.25 * s + 0.75 * smooth((s - 0.15) / 0.7)
}

fn is_in_gauge(x: f64) -> bool {
    (x / LENGTH - 0.5).abs() < 0.3
}

/// Writes the files of a run of ten steps, except for the checkpoints.
pub fn write(dir: &Path, cells: [usize; 3]) {
    let bar = Bar::new(cells);
    let count = bar.elements.len();
    let rves = (0..count).filter(|&e| is_in_gauge(bar.center(e)[0])).count();
    let mut log = LogWriter::create(&dir.join(LOG_FILE)).unwrap();
    let title = "Dogbone in tension".to_owned();
    log.write(&Event::Start(Start {
        title,
        backend: "sparse".into(),
        elements: count,
        nodes: bar.points.len(),
        unknowns: 3 * bar.points.len(),
        rves,
        networks: 12,
        solver: "direct".into(),
        threads: 4,
        ranks: [1, 0],
        version: "0.1.0".into(),
        resumed_from: 0,
        surfaces: [("left", 0.0), ("right", LENGTH)]
            .map(|(name, x)| SurfacePlace { name: name.into(), center: [x, 0.0, 0.0] })
            .to_vec(),
    }))
    .unwrap();
    let names = LoadNames {
        surfaces: ["left", "right", "sides"].map(str::to_owned).to_vec(),
        regions: ["grip", "gauge", "lumen"].map(str::to_owned).to_vec(),
        constraints: vec!["lumen".into()],
        ..LoadNames::default()
    };
    let mut loads = LoadsWriter::create(&dir.join(LOADS_FILE), names).unwrap();
    let mut collection = Collection::new(dir.join(FIELDS_FILE));
    for step in 1..=STEPS {
        let t = step as f64 / STEPS as f64;
        fields(dir, &bar, &mut collection, step, t);
        let (u, f) = (0.25 * t * LENGTH, 0.8 * (2.0 * t).exp_m1());
        let surface = |f: f64, u: f64| SurfaceRow { area: 4.2e-5, force: [f, 1e-9, 0.0], displacement: [u, 0.0, 0.0] };
        let surfaces = vec![surface(-f, 0.0), surface(f, u), surface(1e-12, 0.4 * u)];
        let volumes = vec![1.2e-6, 9.0e-7 * (1.0 - 0.1 * t), 3.0e-8];
        let row = LoadRow { step, t, surfaces, volumes, pressures: vec![120.0 * t], ..LoadRow::default() };
        loads.row(&row).unwrap();
        if step == 7 {
            let reason = "element 17: det F = -0.2 <= 0".into();
            log.write(&Event::Cut(Cut {
                step,
                t,
                reason,
                lost_rve: None,
                newton: newton(step),
                largest_residual: None,
            }))
            .unwrap();
        }
        let rve = Some(RveLog {
            solves: (4 * rves) as u64,
            iterations_total: (18 * rves) as u64,
            iterations_max: 6 + 2 * step as u64,
            iterations_median: Some(4),
            iterations_p95: Some(5 + step as u64),
            iterations_mean: 4.5 + 0.1 * step as f64,
            seconds_cpu: 10.0,
            asleep: 0,
            waiting: 0,
            deleted: 0,
            ..RveLog::default()
        });
        let cuts = u32::from(step == 7);
        log.write(&Event::Step(Step {
            step,
            t,
            increments: 1 + cuts as usize,
            cuts,
            rounds: 0,
            augmentations: 0,
            newton: newton(step),
            rve,
            balance: Default::default(),
            scales: None,
        }))
        .unwrap();
    }
    log.write(&Event::End(End { converged: true, reason: None, steps: STEPS, seconds: 127.3 })).unwrap();
}

/// Writes the fields of one step, displacements and a stress, of a bar of many cells.
#[allow(dead_code, reason = "not all tests with this module use it")]
pub fn write_large(dir: &Path, cells: [usize; 3]) -> usize {
    let bar = Bar::new(cells);
    let displacement: Vec<[f64; 3]> =
        bar.points.iter().map(|[x, ..]| [0.25 * LENGTH * elongation(*x), 0.0, 0.0]).collect();
    let stress: Vec<f64> =
        (0..bar.elements.len()).map(|element| 1e4 * (1.0 + bar.center(element)[0] / LENGTH)).collect();
    let file = field_file(1);
    let set = FieldSet {
        points: &bar.points,
        elements: &bar.elements,
        point_vectors: vec![("displacement", &displacement)],
        cell_scalars: vec![("von_mises_stress", &stress)],
        ..FieldSet::default()
    };
    write_vtu(&dir.join(&file), &set).unwrap();
    Collection::new(dir.join(FIELDS_FILE)).add(1.0, &file).unwrap();
    bar.elements.len()
}

fn newton(step: usize) -> NewtonLog {
    let relative: Vec<f64> = [1.0, 2e-2 * step as f64 / 10.0, 3e-5, 2e-10][..3 + step % 2].to_vec();
    NewtonLog {
        residual: 0.0,
        iterations: relative.len() - 1,
        residuals: relative.iter().map(|r| 3.0 * r).collect(),
        relative,
        line_search_cuts: 0,
        factorizations: Factorizations { cholesky: 3, ..Factorizations::default() },
        linear_iterations: 0,
        linear: Vec::new(),
        linear_starts: Vec::new(),
        fallbacks: 0,
        seconds: NewtonSeconds {
            point_field: 9.0 + step as f64 / 3.0,
            assembly: 0.6,
            factor: 1.1,
            solve: 0.2,
            total: 12.9,
        },
    }
}

fn fields(dir: &Path, bar: &Bar, collection: &mut Collection, step: usize, t: f64) {
    let count = bar.elements.len();
    let stretch = 0.25 * t;
    let moved = |[x, y, z]: [f64; 3]| {
        let local = stretch * (elongation(x + 1e-4) - elongation(x - 1e-4)) / (2e-4 / LENGTH);
        let thin = (1.0 + local.max(0.0)).powf(-0.6) - 1.0;
        [stretch * LENGTH * elongation(x), y * thin, (z - 0.0015) * thin]
    };
    let displacement: Vec<[f64; 3]> = bar.points.iter().map(|&point| moved(point)).collect();
    let (mut stress, mut direction, mut alignment, mut network) = (vec![], vec![], vec![], vec![]);
    for e in 0..count {
        let [x, y, _] = bar.center(e);
        let angle = (0.9 + 0.8 * (noise(e) - 0.5) + 20.0 * y) * (1.0 - 0.85 * t);
        let wide = 0.007 / (0.007 + 0.007 * smooth((2.0 * (x / LENGTH - 0.5).abs() - 0.45) / 0.25));
        stress.push(1.9e4 * (2.0 * t).exp_m1() * wide * wide * (0.85 + 0.3 * noise(7 * e + 1)));
        let strength = 0.03 + 0.3 * t * (0.6 + 0.4 * noise(3 * e));
        let tilt = 0.5 * (noise(5 * e + 2) - 0.5);
        let own = [angle.cos() * tilt.cos(), angle.sin() * tilt.cos(), tilt.sin()];
        direction.push(if is_in_gauge(x) { own } else { [0.0; 3] });
        alignment.push(if is_in_gauge(x) { strength } else { 0.0 });
        network.push(if is_in_gauge(x) { (12.0 * noise(11 * e)) as i64 } else { -1 });
    }
    let tensors: Vec<[f64; 9]> = stress.iter().map(|&s| [s, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).collect();
    let file = field_file(step);
    let set = FieldSet {
        points: &bar.points,
        elements: &bar.elements,
        point_vectors: vec![("displacement", &displacement)],
        cell_scalars: vec![("von_mises_stress", &stress), ("fiber_alignment", &alignment)],
        cell_integers: vec![("network", &network)],
        cell_vectors: vec![("fiber_direction", &direction)],
        cell_tensors: vec![("cauchy_stress", &tensors)],
        ..FieldSet::default()
    };
    write_vtu(&dir.join(&file), &set).unwrap();
    collection.add(t, &file).unwrap();
}
