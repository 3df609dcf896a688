//! Every plot is drawn by itself, on fitted examples and on whatever may go wrong, and what is
//! drawn is looked at number by number.

use std::collections::HashSet;

use leverrier::internals::data::{DataReport, Dataset};
use leverrier::internals::diagnose::comparison::plane::{ForceNode, ForcePlane};
use leverrier::internals::diagnose::comparison::predictions::Prediction;
use leverrier::internals::diagnose::comparison::view::{
    EnergySeries, Portrait, Quantity, View, view,
};
use leverrier::internals::diagnose::comparison::{
    Comparison, EnergyDrift, Horizon, ResidualMap, compare,
};
use leverrier::internals::diagnose::diagnosis::{Diagnosis, RankedEffect, Verdict, diagnose};
use leverrier::internals::diagnose::{self, LawOnData, Measurements};
use leverrier::internals::expr::{Compiled, build};
use leverrier::internals::fit::model::{FrontPoint, PathEntry};
use leverrier::internals::fit::{Model, Options, Silent, fit};
use leverrier::internals::report::html::{HistoryEntry, Page, page};
use leverrier::internals::report::plots::{
    Background, Figure, HistoryPoint, Medium, PLOTS, PictureStyle, PlotData, draw, image, plot,
};
use leverrier::internals::report::present;
use leverrier::internals::simulate::Simulator;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use resvg::tiny_skia::Pixmap;

/// All that a report is made from, owned.
struct Story {
    compiled: Compiled,
    data: Dataset,
    model: Model,
    view: View,
    comparison: Comparison,
    diagnosis: Option<Diagnosis>,
    history: Vec<HistoryPoint>,
}

impl Story {
    fn material(&self) -> PlotData<'_> {
        PlotData {
            view: &self.view,
            comparison: &self.comparison,
            model: &self.model,
            diagnosis: self.diagnosis.as_ref(),
            history: &self.history,
        }
    }
}

/// Runs of a law, with noise.
fn measured(law: &str, starts: &[Vec<f64>], samples: usize, noise: f64) -> Dataset {
    let truth = build("truth", law).unwrap_or_else(|error| panic!("{error}"));
    let simulator = Simulator::known(&truth.system);
    let times: Vec<f64> = (0..samples).map(|i| 0.1 * i as f64).collect();
    let trajectories = simulator.trajectories(starts, &times).unwrap_or_else(|e| panic!("{e}"));
    let mut data = trajectories.dataset(&truth.system);
    let mut generator = Pcg64::seed_from_u64(4);
    for x in data.runs.iter_mut().flat_map(|run| run.values.iter_mut().flatten()) {
        let draw: f64 = StandardNormal.sample(&mut generator);
        *x += noise * draw;
    }
    data
}

fn story(spec: &str, data: Dataset, held_out: f64, ask: bool) -> Story {
    let compiled = build("learned", spec).unwrap_or_else(|error| panic!("{error}"));
    let split = data.split_held_out(held_out, 0);
    let model = fit(&compiled.system, &split.training, &Options::default(), &Silent)
        .unwrap_or_else(|error| panic!("{error}"));
    let (law, options) =
        (model.law(&compiled.system).expect("its own"), diagnose::Options::default());
    let training = LawOnData::of(law.clone(), &split.training, &options);
    let far = training.with_data(&Measurements::of(&split.held_out, &options));
    let far = (!split.held_out.runs.is_empty()).then_some(&far);
    let comparison = compare(&training, far).unwrap_or_else(|error| panic!("{error}"));
    let view = view(&training, far).unwrap_or_else(|error| panic!("{error}"));
    let diagnosis = ask.then(|| {
        let (training, held_out) = (&split.training, &split.held_out);
        diagnose(&compiled, &law, training, held_out, &options, &Silent)
            .unwrap_or_else(|error| panic!("{error}"))
    });
    Story { compiled, data, model, view, comparison, diagnosis, history: Vec::new() }
}

fn damped() -> Story {
    let starts: Vec<Vec<f64>> =
        (0..6).map(|i| vec![0.4 + 0.2 * f64::from(i), 0.3 - 0.1 * f64::from(i)]).collect();
    let law = "coordinates theta [rad]\nmomenta p [rad/s]\ntime t [s]\nT = p^2/2\n\
               V = -1.0 [1/s^2]*cos(theta)\nforce theta += -0.05 [1/s]*p\n";
    let spec = "system \"bench <pendulum> & co\"\ncoordinates theta [rad]\nmomenta p [rad/s]\ntime t [s]\n\
                T = p^2/2\nV = span{ poly(theta; 3), cos(theta) }\n";
    let mut story = story(spec, measured(law, &starts, 120, 0.005), 0.3, true);
    let stage = |action: &str, error, undone| HistoryPoint { action: action.into(), error, undone };
    story.history = vec![
        stage("start", Some(5.0), false),
        stage("add coulomb_friction(theta)", Some(2.0), true),
        stage("edited by hand", None, false),
        stage("add viscous_drag(theta)", Some(1.02), false),
    ];
    story
}

/// Pairs of states of two coordinates.
fn pairs() -> Story {
    let law = "coordinates q[1..2]\nmomenta p[1..2]\nT = (p[1]^2 + p[2]^2)/2\n\
               V = (q[1]^2 + q[2]^2)/2 + q[1]^2*q[2] - q[2]^3/3\n";
    let starts: Vec<Vec<f64>> = (0..300)
        .map(|i| (0..4).map(|k| 0.4 * ((i * (k + 3)) as f64 * 0.71 + k as f64).sin()).collect())
        .collect();
    let spec =
        "coordinates q[1..2]\nmomenta p[1..2]\nT = span{ poly(p; 2) }\nV = span{ poly(q; 3) }\n";
    story(spec, measured(law, &starts, 2, 0.002), 0.25, false)
}

/// One run of velocities with a hole, missing cells, and nothing held out.
fn holes() -> Story {
    let law = "coordinates x\nmomenta p\nT = p^2/2\nV = x^2/2\n";
    let mut data = measured(law, &[vec![1.0, 0.0]], 200, 0.01);
    data.observables = vec!["x".into(), "v".into()];
    let run = &mut data.runs[0];
    for at in [5, 6, 17, 150] {
        run.values[1][at] = f64::NAN;
    }
    for time in run.times.iter_mut().skip(100) {
        *time += 7.0;
    }
    let spec = "coordinates x\nvelocities v\nT = p_x^2/2\nV = span{ poly(x; 4) }\n";
    story(spec, data, 0.0, false)
}

/// Numbers that a data set may bring about, and nothing else.
fn broken(value: f64) -> Story {
    let mut story = holes();
    let quantity = |name: &str| Quantity { name: name.into(), unit: Some("<m>".into()) };
    let series = vec![value; 5];
    story.view = View {
        system: "broken".into(),
        state: vec![quantity("x"), quantity("p")],
        observables: vec![quantity("x"), quantity("p")],
        time: quantity("t"),
        noise: vec![value, value],
        predictions: vec![Prediction {
            run: "a \"b\" & <c>\u{1}".into(),
            held_out: false,
            times: vec![0.0, 1.0, 2.0, 3.0, value],
            measured: vec![series.clone(), vec![0.0, 1.0, value, 3.0, 4.0]],
            predicted: vec![series.clone(), vec![1e300, -1e300, value, 0.0, 1e-300]],
            states: vec![series.clone(), series.clone()],
            energy: series.clone(),
            starts: vec![0],
            error: 1.0,
        }],
        momenta_measured: true,
        energies: vec![EnergySeries {
            run: "a".into(),
            held_out: true,
            points: vec![(0.0, value), (1.0, 2.0), (value, 3.0)],
        }],
        portraits: vec![Portrait {
            across: 0,
            up: 1,
            held: vec![(0, value)],
            columns: vec![-1.0, 0.0, 1.0],
            rows: vec![-1.0, 1.0],
            energy: vec![vec![value, 1.0, 2.0], vec![0.0, value, 1.0]],
            reached: Some((value, 1.0)),
        }],
        planes: vec![ForcePlane {
            coordinate: 0,
            across: vec![0.0, 1.0],
            up: vec![0.0, 1e-30],
            nodes: vec![ForceNode {
                column: 0,
                row: 1,
                force: value,
                standard_error: 0.0,
                samples: 4,
            }],
            deviance: value,
            degrees: 1,
            p_value: value,
        }],
    };
    story.comparison = Comparison {
        horizons: vec![
            Horizon {
                samples: 2,
                duration: 0.1,
                training: value,
                held_out: Some(value),
                baseline: 1e300,
                diverged: 3,
            },
            Horizon {
                samples: 4,
                duration: value,
                training: 2.0,
                held_out: None,
                baseline: 0.0,
                diverged: 0,
            },
        ],
        noise_floor: vec![("x".into(), Some(value))],
        maps: vec![ResidualMap {
            on: "x".into(),
            against: "p".into(),
            points: vec![(0.0, value, 1.0), (1.0, 2.0, value), (2.0, 1.0, 0.0), (3.0, 1.0, 1.0)],
            deviance: value,
            degrees: 0,
            p_value: value,
        }],
        energy: vec![EnergyDrift {
            run: "a".into(),
            first: value,
            last: 1.0,
            rate: value,
            rate_error: 0.1,
        }],
        findings: vec![String::new(), "<b>".into()],
    };
    let point = |terms: usize, error| FrontPoint {
        terms: vec!["x^2".to_string(); terms],
        error,
        criterion: value,
        chosen: terms == 1,
    };
    story.model.front = vec![point(0, value), point(1, 2.0), point(3, 1e-300)];
    story.model.path = vec![
        PathEntry { lambda: value, coefficients: vec![("x^2".into(), 1.0)] },
        PathEntry { lambda: 1.0, coefficients: vec![("x^2".into(), value), ("x^3".into(), 2.0)] },
        PathEntry { lambda: 0.1, coefficients: vec![("x^2".into(), 1e200)] },
    ];
    let leader = RankedEffect {
        number: None,
        left_out: None,
        effect: "an_effect_with_a_very_long_name(theta_one, theta_two)".into(),
        on: vec![],
        snippet: "effect <a>".into(),
        coefficient: vec![value],
        standard_error: vec![value],
        p_value: value,
        tests: 1.0,
        deviance: value,
        held_out_error_before: value,
        held_out_error_after: 1.0,
        indistinguishable: Vec::new(),
    };
    story.diagnosis = Some(Diagnosis {
        verdict: Verdict::Missing,
        ranking: vec![leader.clone()],
        indistinguishable: vec!["b".into()],
        further: vec![leader.clone()],
        unnamed: Some(leader),
        unnamed_explains_more: true,
        shape: story.comparison.maps.first().cloned(),
        held_out_error: value,
        ..Diagnosis::too_little("x < y".into())
    });
    let stage = |error| HistoryPoint { action: "add".into(), error, undone: false };
    story.history = vec![stage(Some(value)), stage(None), stage(Some(1e9)), stage(Some(1.0))];
    story
}

/// Everything empty.
fn empty() -> Story {
    let mut story = holes();
    let view = &mut story.view;
    view.predictions.clear();
    view.energies.clear();
    view.portraits.clear();
    view.planes.clear();
    story.comparison.horizons.clear();
    story.comparison.maps.clear();
    story.comparison.energy.clear();
    story.model.front.clear();
    story.model.path.clear();
    story
}

/// Points that a path goes through, relative commands included.
fn path_points(path: &str) -> Vec<(f64, f64)> {
    let mut out = Vec::new();
    let (mut x, mut y) = (0.0f64, 0.0f64);
    let mut rest = path;
    while let Some(command) = rest.chars().next() {
        let end = rest[1..]
            .find(|c: char| c.is_ascii_alphabetic() && c != 'e')
            .map_or(rest.len(), |i| i + 1);
        let numbers: Vec<f64> = rest[1..end]
            .split_whitespace()
            .map(|number| number.parse().unwrap_or_else(|_| panic!("{number} in {path}")))
            .collect();
        assert!(numbers.iter().all(|n| n.is_finite()), "{path}");
        (x, y) = match (command, &numbers[..]) {
            ('M' | 'L', [a, b]) => (*a, *b),
            ('m' | 'l', [a, b]) => (x + a, y + b),
            ('H', [a]) => (*a, y),
            ('h', [a]) => (x + a, y),
            ('V', [a]) => (x, *a),
            ('v', [a]) => (x, y + a),
            ('a', [.., a, b]) => (x + a, y + b),
            ('z', []) => (x, y),
            other => panic!("{other:?} in {path}"),
        };
        out.push((x, y));
        rest = &rest[end..];
    }
    out
}

/// A drawing is XML, has a title and a description, and every number of it lies in its view box.
fn inspect(figure: &Figure, what: &str) {
    let look = PictureStyle { paper: Some(Background::Dark), scale: 1.0 };
    let png = (image("png").expect("a row").draw)(figure, look).expect("pixels");
    let png = Pixmap::decode_png(&png).unwrap_or_else(|error| panic!("{what}: {error}"));
    assert_eq!((f64::from(png.width()), f64::from(png.height())), (figure.width, figure.height));
    for target in [Medium::File, Medium::Page, Medium::Print(Background::Dark)] {
        let svg = draw(figure, target);
        let document = roxmltree::Document::parse(&svg)
            .unwrap_or_else(|error| panic!("{what}: {error}\n{svg}"));
        let root = document.root_element();
        let view: Vec<f64> = root
            .attribute("viewBox")
            .expect("a view box")
            .split(' ')
            .map(|number| number.parse().expect("a number"))
            .collect();
        assert_eq!(root.attribute("role"), Some("img"));
        for name in ["title", "desc"] {
            let node = root
                .children()
                .find(|node| node.has_tag_name(("http://www.w3.org/2000/svg", name)));
            let text = node.and_then(|node| node.text()).unwrap_or("");
            assert!(!text.trim().is_empty(), "{what}: no {name}");
        }
        let inside = |x: f64, y: f64| {
            let room = 1.0;
            assert!(
                x >= -room && y >= -room && x <= view[2] + room && y <= view[3] + room,
                "{what}: {x}, {y} lies outside {view:?}\n{svg}"
            );
        };
        for node in root.descendants().filter(|node| node.is_element()) {
            let number = |name: &str| -> f64 {
                let text = node.attribute(name).unwrap_or("0");
                let value: f64 = text.parse().unwrap_or_else(|_| panic!("{what}: {name}={text}"));
                assert!(value.is_finite(), "{what}: {name}={text}");
                value
            };
            match node.tag_name().name() {
                "path" => {
                    for (x, y) in path_points(node.attribute("d").expect("a path")) {
                        inside(x, y);
                    }
                }
                "rect" => {
                    inside(number("x"), number("y"));
                    inside(number("x") + number("width"), number("y") + number("height"));
                    assert!(number("width") >= 0.0 && number("height") >= 0.0, "{what}");
                }
                "text" => {
                    inside(number("x"), number("y"));
                    let text: String = node.descendants().filter_map(|n| n.text()).collect();
                    assert!(!text.contains("NaN") && !text.contains("inf"), "{what}: {text}");
                }
                _ => {}
            }
        }
    }
}

fn inspect_all(story: &Story, what: &str) -> Vec<&'static str> {
    let material = story.material();
    let mut drawn = Vec::new();
    let mut names = HashSet::new();
    for row in PLOTS {
        let figures = (row.figures)(&material);
        for figure in &figures {
            inspect(figure, &format!("{what}, {}", figure.id));
            assert!(names.insert(figure.id.clone()), "{what}: {} twice", figure.id);
        }
        if !figures.is_empty() {
            drawn.push(row.name);
        }
    }
    drawn
}

#[test]
fn every_plot_of_a_damped_pendulum_is_drawn() {
    let story = damped();
    let drawn = inspect_all(&story, "damped");
    let all: Vec<&str> = PLOTS.iter().map(|row| row.name).collect();
    assert_eq!(drawn, all);
    let ranking = (plot("ranking").expect("a row").figures)(&story.material());
    assert!(draw(&ranking[0], Medium::Page).contains("viscous_drag(theta)"));
    let forces = (plot("forces").expect("a row").figures)(&story.material());
    let svg = draw(&forces[0], Medium::Page);
    assert!(svg.contains("[rad/s]") || svg.contains("[rad]") || svg.contains("[s]"), "{svg}");
}

#[test]
fn pairs_and_runs_with_holes_are_drawn() {
    let drawn = inspect_all(&pairs(), "pairs");
    for name in ["predictions", "forces", "force-map", "portrait", "path", "front"] {
        assert!(drawn.contains(&name), "{name}: {drawn:?}");
    }
    let story = holes();
    let drawn = inspect_all(&story, "holes");
    for name in ["predictions", "horizons", "portrait", "energy"] {
        assert!(drawn.contains(&name), "{name}: {drawn:?}");
    }
    assert!(!drawn.contains(&"ranking") && !drawn.contains(&"ledger"));
    assert_eq!(story.view.predictions[0].starts, [0, 100]);
}

#[test]
fn nothing_and_numbers_that_are_none_are_drawn_without_harm() {
    assert_eq!(inspect_all(&empty(), "empty"), Vec::<&str>::new());
    for value in [f64::NAN, f64::INFINITY, -f64::INFINITY, 0.0, 1e308, -1e308, 1e-308, 1.0] {
        inspect_all(&broken(value), &format!("broken {value}"));
    }
}

#[test]
fn predictions_follow_the_data_to_the_noise() {
    let story = holes();
    for prediction in &story.view.predictions {
        assert!((0.8..1.2).contains(&prediction.error), "{}", prediction.error);
    }
    let portrait = &story.view.portraits[0];
    // Energy is (x^2 + p^2)/2 over the plane of x and p.
    for (row, &p) in portrait.rows.iter().enumerate() {
        for (column, &x) in portrait.columns.iter().enumerate() {
            let energy = portrait.energy[row][column] - portrait.energy[40][40];
            let (x0, p0) = (portrait.columns[40], portrait.rows[40]);
            let expected = 0.5 * (x * x + p * p - x0 * x0 - p0 * p0);
            assert!((energy - expected).abs() < 0.02, "{energy} {expected}");
        }
    }
}

fn html(story: &Story) -> String {
    let system = &story.compiled.system;
    let law = story.model.law(system).expect("its own");
    let simplified = present::simplified(&law, &[]);
    let notes = present::notes(&simplified);
    let history = [HistoryEntry {
        date: "2026-01-01 00:00".into(),
        action: "start <now>".into(),
        before: None,
        after: Some(f64::NAN),
        undone: true,
    }];
    let drawn = page(&Page {
        title: &system.name,
        material: story.material(),
        model: Some(&story.model),
        simplified: &simplified,
        formulas: &[],
        notes: &notes,
        data: &DataReport::of(&story.data),
        split: "a split.",
        terms_from: "a model",
        spec: "T = p^2/2 # a < b\n",
        history: &history,
        facts: &[("seed".into(), "0".into())],
        commands: &["leverrier fit a.ham".into()],
    });
    drawn.html
}

/// A page loads nothing, closes what it opens, and names nothing twice.
fn inspect_page(html: &str) {
    for (at, _) in html.match_indices("http") {
        let place = &html[at..(at + 40).min(html.len())];
        let known =
            ["http://www.w3.org/2000/svg", "http://www.w3.org/1998/Math/MathML", "http-equiv"];
        assert!(known.iter().any(|start| place.starts_with(start)), "{place}");
    }
    assert!(!html.contains(" src=") && !html.contains("@import") && !html.contains("url("));
    for tag in ["section", "svg", "figure", "table", "div", "details", "ul", "li", "g", "text"] {
        let open =
            html.matches(&format!("<{tag}>")).count() + html.matches(&format!("<{tag} ")).count();
        assert_eq!(open, html.matches(&format!("</{tag}>")).count(), "{tag}");
    }
    let mut ids = HashSet::new();
    for part in html.split(" id=\"").skip(1) {
        let id = part.split('"').next().unwrap_or("");
        assert!(ids.insert(id), "{id} twice");
    }
    for part in html.split("<a href=\"#").skip(1) {
        let id = part.split('"').next().unwrap_or("");
        assert!(ids.contains(id), "a link to {id}, which is not there");
    }
}

#[test]
fn pages_stand_alone() {
    for (story, what) in
        [(damped(), "damped"), (pairs(), "pairs"), (empty(), "empty"), (broken(f64::NAN), "broken")]
    {
        let html = html(&story);
        inspect_page(&html);
        assert!(html.contains("To reproduce this page") && html.contains("a &lt; b"), "{what}");
        assert!(!html.contains("NaN"), "{what}");
    }
    let html = html(&damped());
    assert!(html.contains("bench &lt;pendulum&gt; &amp; co"));
    assert!(html.contains("viscous_drag(theta)") && html.contains("Findings"));
}

#[test]
fn a_hundred_thousand_samples_stay_small() {
    let mut story = damped();
    let count = 50_000;
    let noisy = |i: usize, phase: f64| {
        (0.013 * i as f64 + phase).sin() + 0.1 * ((i * 7919) % 1000) as f64 / 1000.0
    };
    story.view.predictions = (0..2)
        .map(|run| {
            let series = |phase: f64| (0..count).map(|i| noisy(i, phase)).collect::<Vec<f64>>();
            Prediction {
                run: run.to_string(),
                held_out: run == 1,
                times: (0..count).map(|i| 0.01 * i as f64).collect(),
                measured: vec![series(0.0), series(1.6)],
                predicted: vec![series(0.1), series(1.7)],
                states: vec![series(0.1), series(1.7)],
                energy: series(0.2),
                starts: vec![0],
                error: 2.0,
            }
        })
        .collect();
    let html = html(&story);
    inspect_page(&html);
    assert!(html.len() < 4_000_000, "{} bytes", html.len());
    inspect_all(&story, "many");
}

#[test]
fn figures_and_their_data_are_plain_for_programs() {
    let story = damped();
    let value = serde_json::to_value(story.material()).expect("plain data");
    assert!(value["view"]["predictions"][0]["predicted"][0][0].is_f64());
    for row in PLOTS {
        for figure in (row.figures)(&story.material()) {
            let value = serde_json::to_value(&figure).expect("plain data");
            assert!(value["panels"][0]["x"]["high"].is_number(), "{}", figure.id);
        }
    }
}

#[test]
fn rows_have_names_of_their_own() {
    let names: HashSet<&str> = PLOTS.iter().map(|row| row.name).collect();
    assert_eq!(names.len(), PLOTS.len());
    for row in PLOTS {
        assert!(row.name.chars().all(|c| c.is_ascii_lowercase() || c == '-'));
        assert!(row.absent.ends_with('.') && !row.title.is_empty());
        assert!(plot(row.name).is_some());
    }
}
