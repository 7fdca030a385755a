//! Writing a case and reading it again.

use super::super::*;
use super::{FULL, Folder, SMALL};
use crate::fiber::law::{FormulaLaw, Parameter, ParameterRange};

/// Returns the case without its file and line numbers.
fn placeless(mut case: Case) -> Case {
    case.file.clear();
    case.mesh_line = 0;
    case.mesh_scale_line = None;
    case.quadratic.iter_mut().for_each(|each| each.line = 0);
    for each in &mut case.regions {
        each.line = 0;
        let formula = match &mut each.material {
            RegionMaterial::Formula(formula) => Some(formula),
            RegionMaterial::FiberRve(rve) => {
                if let NetworkAssignment::Field(choice) = &mut rve.assignment {
                    choice.line = 0;
                    for field in &mut choice.fields {
                        field.line = 0;
                        forget_line(&mut field.values);
                    }
                }
                if let RveScale::Fractions(field) = &mut rve.scale {
                    field.line = 0;
                }
                rve.matrix.as_mut()
            }
        };
        if let Some(FormulaCase::Field(field)) = formula {
            field.line = 0;
            field.parameters.iter_mut().for_each(|(_, parameter)| forget_line(parameter));
            for axis in &mut field.axes {
                match axis {
                    AxisCase::Constant(_) => {}
                    AxisCase::Components(components) => components.iter_mut().for_each(forget_line),
                    AxisCase::Field(field) => field.line = 0,
                }
            }
        }
    }
    case.boundaries.iter_mut().for_each(|each| each.line = 0);
    case.points.iter_mut().for_each(|each| each.line = 0);
    case.body_forces.iter_mut().for_each(|each| each.line = 0);
    case.constraints.iter_mut().for_each(|each| each.line = 0);
    case
}

fn forget_line(parameter: &mut ParameterCase) {
    if let ParameterCase::Field(field) = parameter {
        field.line = 0;
    }
}

#[test]
fn written_case_reads_the_same_from_another_folder() {
    let folder = Folder::new();
    let elsewhere = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("curve.csv"), "stretch,stress\n0.9,-1e6\n1,0\n1.3,3.1415926535e7\n").unwrap();
    let law = |text: &str| {
        let start = FULL.find("law = ").unwrap();
        let end = start + FULL[start..].find('\n').unwrap();
        format!("{}{text}{}", &FULL[..start], &FULL[end..])
    };
    let boxed = r#"generate = { shape = "box", cells = [4, 1, 2], size = [0.1, 1, 1e-3] }"#;
    let cases = [
        FULL.to_string(),
        SMALL.to_string(),
        law(""),
        law(r#"law = { name = "linear", youngs_modulus = 0.1, radius = 3e-310 }"#),
        law(r#"law = { name = "exponential", youngs_modulus = 1, radius = 1, nonlinearity = 1, compression = 0 }"#),
        law(r#"law = { name = "linear", youngs_modulus = 1, radius = 1, buckling_strain = 0.3, compression = 0.1 }"#),
        law(r#"law = { name = "table", radius = 1, points = [[0.9, -0.1], [1, 0], [1.1, 1e5]], compression = 0.5 }"#),
        law(r#"law = { name = "table", radius = 1, file = "curve.csv" }"#),
        law(r#"law = { name = "exponential", youngs_modulus = 1e300, radius = 0.3, nonlinearity = 0.1 }"#),
        FULL.replace("fiber_volume_fraction = 0.003", "scale = \"raw\"").replace("[17, 0, 17]", "\"all\""),
        FULL.replace(
            "file = \"sample.msh\"",
            &boxed.replace(" }", ", element = \"hex8\" }\norder = 2\nhexahedra = 27"),
        ),
        FULL.replace("file = \"sample.msh\"", "file = \"sample.msh\"\norder = 2"),
        format!("{SMALL}[[constraint]]\ncavity = \"a \\\" b\"\nvolume = \"constant\"\nmethod = \"penalty\"\n"),
        FULL.replace("file = \"sample.msh\"", &boxed.replace(" }", ", element = \"wedge6\" }\norder = 1")),
        FULL.replace(
            "file = \"sample.msh\"",
            r#"generate = { shape = "tube", cells = [1, 9, 2], inner_radius = 0.1, outer_radius = 0.3, length = 1e-3 }"#,
        ),
        FULL.replace("file = \"sample.msh\"", boxed).replace("\"cycle\"", "\"random\""),
        FULL.replace("\"Dogbone in tension\"", r#""a \"b\" \\ \n \u0001 é ' '''""#),
        format!(
            "{SMALL}[body]\nfree = \"rigid\"\n[[boundary]]\nsurface = \"right\"\nsymmetry = true\n[[boundary]]\n\
             surface = \"sides\"\nrigid = {{ reference = [0.1, 2, 3e-9], rotation = {{ x = 0.3, z = \"x\" }}, displacement = {{ y = 1e-4 }} }}\n\
             curve = [[0, 0], [1, 2]]\n"
        ),
        format!("{SMALL}[[boundary]]\nsurface = \"right\"\nrigid = {{ rotation = {{ x = \"pi*t^2\" }} }}\n"),
        format!("{SMALL}[[boundary]]\nsurface = \"right\"\nrigid = {{}}\n"),
        format!(
            "{SMALL}[[boundary]]\nsurface = \"a\"\ntraction = [\"1e3*t*z\", 0, \"2*3\"]\n[[boundary]]\nsurface = \"a\"\n\
             pressure = \"x\"\ncurve = \"t^2\"\n[[point]]\nnode = 1\ndisplacement = {{ x = \"0.1*y\" }}\n\
             force = [0, \"t\", 0]\n[[body_force]]\nregion = \"*\"\nvalue = [\"-y\", 1, 0]\ncurve = [[0, 0], [1, 2]]\n"
        ),
        FULL.replace("\"cycle\"", "{ index = { grid = \"curve.csv\" } }")
            .replace("fiber_volume_fraction = 0.003", "fiber_volume_fraction = { cells = \"phi\" }"),
        FULL.replace("[\"networks/*.txt*\"]", "\"networks/{k:01}{of one}.txt\"").replace("{of one}", "{of-one}").replace(
            "\"cycle\"",
            "{ k = { file = \"curve.csv\", column = \"k\", bins = 20, range = [-1, 0.5], first = 3 }, of-one = \"2*x\" }",
        ),
        FULL.replace("seed = 7", "seed = 9223372036854775807").replace("every = 5", "every = 0x10"),
    ];
    // Every law with scalar parameters, at the lower bounds that belong to their ranges.
    let formulas = FormulaLaw::ALL.iter().map(|formula| {
        let value = |parameter: &Parameter| match parameter.range {
            ParameterRange::Above(low) => low + 1.5,
            ParameterRange::AtLeast(low) | ParameterRange::FromTo(low, _) => low,
        };
        let entries: String = formula
            .parameters()
            .iter()
            .map(|parameter| format!(", {} = {:?}", parameter.name, value(parameter)))
            .collect();
        law(&format!("law = {{ name = \"{}\", radius = 1{entries} }}", formula.name()))
    });
    let materials = [
        r#"model = "linear-elastic", youngs_modulus = 1.0e5, poisson_ratio = 0.1"#,
        r#"model = "holmes-mow", youngs_modulus = 1.0e5, poisson_ratio = 0.1, beta = 0.7"#,
        r#"model = "transversely-isotropic", youngs_modulus = 1.0e5, poisson_ratio = 0.2, axial_youngs_modulus = 4e5, axial_shear_modulus = 6e4, axis = [1, 2, 3]"#,
        r#"model = "holzapfel-gasser-ogden", shear_modulus = 3e3, k1 = 2e3, k2 = 0.8, bulk_modulus = 1e6, axes = [[0.3, -1e9, 0]]"#,
        r#"model = "holzapfel-gasser-ogden", shear_modulus = 3e3, k1 = 2e3, k2 = 0.8, dispersion = 0.2, bulk_modulus = 1e6, axes = [[1, 2, 0], [1e-300, -2e-300, 0]]"#,
        r#"model = "guccione", c = 2e3, bf = 8, bt = 2, bfs = 4, bulk_modulus = 1e6, axis = [0.1, 0.2, 0.7]"#,
        r#"model = "neo-hookean", youngs_modulus = "1e3*(1 + x)", poisson_ratio = { cells = "nu" }"#,
        r#"model = "guccione", c = "2e3", bf = { file = "curve.csv", column = "stretch" }, bt = 2, bfs = 4, bulk_modulus = 1e6, axis = ["-y", "x", 0]"#,
        r#"model = "transversely-isotropic", youngs_modulus = 1.0e5, poisson_ratio = 0.2, axial_youngs_modulus = 4e5, axial_shear_modulus = 6e4, axis = { cells = "fiber" }"#,
        r#"model = "holzapfel-gasser-ogden", shear_modulus = 3e3, k1 = 2e3, k2 = 0.8, bulk_modulus = 1e6, axes = [[1, 0, 0], { file = "curve.csv", columns = ["a", "b", "c"] }]"#,
    ];
    let small = "model = \"neo-hookean\", shear_modulus = 1.0e5, lame_lambda = 2.0e5";
    assert!(SMALL.contains(small));
    let materials = materials.map(|material| SMALL.replace(small, material));
    let parallel = FULL.find("matrix = ").unwrap();
    let end = parallel + FULL[parallel..].find('\n').unwrap();
    let matrix =
        r#"matrix = { model = "guccione", c = 2e3, bf = 8, bt = 2, bfs = 4, bulk_modulus = 1e6, axis = [0, 1, 0] }"#;
    let parallel = format!("{}{matrix}{}", &FULL[..parallel], &FULL[end..]);
    for text in &cases.into_iter().chain(formulas).chain(materials).chain([parallel]).collect::<Vec<_>>() {
        let case = folder.parse(text).unwrap_or_else(|errors| panic!("{errors}\n{text}")).case;
        let written = case.to_toml();
        let again = Case::parse(&written, &elsewhere.path().join("case.toml"));
        let again = again.unwrap_or_else(|errors| panic!("{errors}\n{written}")).case;
        assert_eq!(again.to_toml(), written);
        assert_eq!(placeless(again), placeless(case), "{written}");
    }
}

#[test]
fn written_case_holds_the_defaults() {
    let written = Folder::new().parse(SMALL).unwrap().case.to_toml();
    for line in [
        "title = \"pull\"",
        "count = 10",
        "tolerance = 1e-8",
        "line_search = true",
        "start = \"tangent\"",
        "rve = \"none\"",
    ] {
        assert!(written.lines().any(|written| written == line), "{line} is not in\n{written}");
    }
    // The checkpoints of earlier versions hold cases without these keys.
    for key in ["element =", "order =", "hexahedra =", "points =", "[body]"] {
        assert!(!written.contains(key), "{key} is in\n{written}");
    }
}
