//! Sparse algebra against the dense factor: what is left out must not show.

use std::sync::atomic::{AtomicUsize, Ordering};

use leverrier::internals::data::Dataset;
use leverrier::internals::diagnose::candidates::candidates;
use leverrier::internals::diagnose::tuning::Tuning;
use leverrier::internals::expr::{FunctionSpace, Scope, build};
use leverrier::internals::fit::{Model, Monitor, Options, Silent, StopReason, fit};
use leverrier::internals::simulate::{NoiseLevel, Simulator, add_noise};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// A law and a function space on a graph of couplings: masses, springs, and springs to the ground
/// that harden, of which every fifth is there.
struct Graph {
    degrees: usize,
    edges: Vec<(usize, usize)>,
}

impl Graph {
    fn chain(degrees: usize) -> Graph {
        Graph { degrees, edges: (1..degrees).map(|i| (i, i + 1)).collect() }
    }

    /// A chain with some chords between sites that are up to eight apart.
    fn with_chords(degrees: usize, chords: usize, seed: u64) -> Graph {
        let mut graph = Graph::chain(degrees);
        let mut generator = Pcg64::seed_from_u64(seed);
        while graph.edges.len() < degrees - 1 + chords {
            let a = generator.random_range(1..=degrees - 8);
            let edge = (a, a + generator.random_range(2..=8));
            if !graph.edges.contains(&edge) {
                graph.edges.push(edge);
            }
        }
        graph
    }

    /// A square lattice, site after site of each row.
    fn lattice(side: usize) -> Graph {
        let site = |row: usize, column: usize| side * row + column;
        let along = (0..side).flat_map(|r| (1..side).map(move |c| (site(r, c), site(r, c + 1))));
        let across = (1..side).flat_map(|r| (1..=side).map(move |c| (site(r - 1, c), site(r, c))));
        Graph { degrees: side * side, edges: along.chain(across).collect() }
    }

    fn header(&self) -> String {
        format!("coordinates q[1..{0}]\nmomenta p[1..{0}]\n", self.degrees)
    }

    fn truth(&self) -> String {
        let (mut kinetic, mut potential) = (Vec::new(), Vec::new());
        for i in 1..=self.degrees {
            kinetic.push(format!("{}*p[{i}]^2", 0.4 + 0.02 * (i % 9) as f64));
            if i % 5 == 0 {
                potential.push(format!("0.25*q[{i}]^4"));
            }
        }
        for (at, (a, b)) in self.edges.iter().enumerate() {
            potential.push(format!("{}*(q[{b}] - q[{a}])^2", 0.5 + 0.03 * (at % 7) as f64));
        }
        format!("{}T = {}\nV = {}\n", self.header(), kinetic.join(" + "), potential.join(" + "))
    }

    fn space(&self) -> String {
        let springs: Vec<String> =
            self.edges.iter().map(|(a, b)| format!("(q[{b}] - q[{a}])^2")).collect();
        format!(
            "{}T = span{{ p[i]^2 for i in 1..{n} }}\nV = span{{ {}, q[i]^4 for i in 1..{n} }}\n",
            self.header(),
            springs.join(", "),
            n = self.degrees
        )
    }

    /// Terms of the truth.
    fn terms(&self) -> usize {
        self.degrees + self.edges.len() + self.degrees / 5
    }

    fn measured(&self, runs: usize, times: &[f64], noise: f64) -> Dataset {
        let law = build("truth", &self.truth()).unwrap_or_else(|error| panic!("{error}"));
        let mut generator = Pcg64::seed_from_u64(7);
        let starts: Vec<Vec<f64>> = (0..runs)
            .map(|_| (0..2 * self.degrees).map(|_| generator.random_range(-1.2..1.2)).collect())
            .collect();
        let motion = Simulator::known(&law.system).trajectories(&starts, times);
        let mut data = motion.unwrap_or_else(|error| panic!("{error}")).dataset(&law.system);
        let noise = vec![NoiseLevel::Absolute(noise); data.observables.len()];
        add_noise(&mut data, &noise, 3).expect("a positive sigma");
        data
    }

    fn learn(&self, data: &Dataset, options: &Options) -> Model {
        let space = build("space", &self.space()).unwrap_or_else(|error| panic!("{error}"));
        fit(&space.system, data, options, &Silent).unwrap_or_else(|error| panic!("{error}"))
    }
}

/// Every coefficient, error and noise is that of the dense factor.
fn assert_same(sparse: &Model, dense: &Model) {
    let names = |model: &Model| -> Vec<String> {
        model.terms.iter().map(|term| term.term.clone()).collect()
    };
    assert_eq!(names(sparse), names(dense));
    for (a, b) in sparse.terms.iter().zip(&dense.terms) {
        let apart = (a.coefficient - b.coefficient).abs() / b.standard_error;
        assert!(apart < 1e-3, "{}: {apart:.1e} standard errors apart", a.term);
        let errors = (a.standard_error / b.standard_error - 1.0).abs();
        assert!(errors < 1e-3, "{}: errors differ by {errors:.1e}", a.term);
    }
    for (a, b) in sparse.noise.iter().zip(&dense.noise) {
        let part = (a.standard_deviation / b.standard_deviation - 1.0).abs();
        assert!(part < 1e-3, "{}: noise differs by {part:.1e}", a.observable);
    }
}

fn dense() -> Options {
    let mut options = Options::default();
    options.tuning.local.degrees = usize::MAX;
    options
}

/// Sparse algebra whatever it costs.
fn sparse() -> Options {
    let mut options = Options::default();
    options.tuning.local.share = f64::INFINITY;
    options
}

fn went_sparse(model: &Model) -> bool {
    // The dense search walks along an L1 path.
    model.path.is_empty()
}

#[test]
fn a_chain_is_learned_as_by_the_dense_factor() {
    let graph = Graph::chain(24);
    let data = graph.measured(300, &[0.0, 0.1], 0.005);
    let (sparse, dense) = (graph.learn(&data, &sparse()), graph.learn(&data, &dense()));
    assert!(went_sparse(&sparse) && !went_sparse(&dense));
    assert_eq!(sparse.terms.len(), graph.terms());
    assert_same(&sparse, &dense);
}

#[test]
fn couplings_of_any_graph_are_followed() {
    for seed in [1, 2] {
        let graph = Graph::with_chords(20, 6, seed);
        let data = graph.measured(300, &[0.0, 0.1], 0.005);
        let (sparse, dense) = (graph.learn(&data, &sparse()), graph.learn(&data, &dense()));
        assert!(went_sparse(&sparse) && !went_sparse(&dense));
        assert_same(&sparse, &dense);
    }
}

#[test]
fn a_lattice_is_learned_as_by_the_dense_factor() {
    let graph = Graph::lattice(5);
    let data = graph.measured(300, &[0.0, 0.1], 0.005);
    let (sparse, dense) = (graph.learn(&data, &sparse()), graph.learn(&data, &dense()));
    assert!(went_sparse(&sparse) && !went_sparse(&dense));
    assert_eq!(sparse.terms.len(), graph.terms());
    assert_same(&sparse, &dense);
}

/// Stops when it has been asked so often.
struct Patience {
    questions: AtomicUsize,
    allowed: usize,
}

impl Monitor for Patience {
    fn stage(&self, _: &str, _: f64) {}

    fn stopped(&self) -> bool {
        self.questions.fetch_add(1, Ordering::Relaxed) >= self.allowed
    }
}

#[test]
fn a_pass_that_is_stopped_ends_there_and_a_model_is_kept() {
    let graph = Graph::chain(20);
    let data = graph.measured(640, &[0.0, 0.1], 0.005);
    let space = build("space", &graph.space()).unwrap_or_else(|error| panic!("{error}"));
    let learn = |allowed: usize| {
        let patience = Patience { questions: AtomicUsize::new(0), allowed };
        let model = fit(&space.system, &data, &sparse(), &patience);
        (model.unwrap_or_else(|error| panic!("{error}")), patience.questions.into_inner())
    };
    let (whole, all) = learn(usize::MAX);
    assert_eq!(whole.stop.reason, StopReason::Converged);
    for allowed in [1, all / 3, all / 2, 3 * all / 4, all - 60] {
        let (model, asked) = learn(allowed);
        assert_eq!(model.stop.reason, StopReason::Interrupted, "{allowed} of {all}");
        // Each of 16 folds asks once more, and so do those who lead them.
        assert!(asked <= allowed + 24, "{allowed} of {all}: asked {asked} times");
        assert!(model.terms.len() >= graph.degrees, "{allowed}: {} terms", model.terms.len());
        assert!([256, 640].contains(&model.evidence.segments), "{}", model.evidence.segments);
    }
}

#[test]
fn effects_on_two_of_many_coordinates_are_asked_for_where_they_touch() {
    let pairs = |degrees: usize, springs: &str, all: bool| {
        let spec = format!(
            "coordinates q[1..{degrees}]\nmomenta p[1..{degrees}]\n\
             T = sum(p[i]^2/2 for i in 1..{degrees})\nV = {springs}\n"
        );
        let space = build("pairs", &spec).unwrap_or_else(|error| panic!("{error}"));
        let data = Graph::chain(degrees).measured(2, &[0.0, 0.1], 0.005);
        let mut tuning = Tuning::default().candidates;
        if all {
            tuning.pair_coordinates = usize::MAX;
        }
        let found = candidates(&mut Scope::of(&space), &data, &tuning);
        let damped = found.into_iter().filter(|one| one.label.starts_with("relative_damping"));
        damped.map(|one| one.on).collect::<Vec<_>>()
    };
    let chain = |n: usize| format!("sum((q[i+1] - q[i])^2/2 for i in 1..{})", n - 1);
    let asked = pairs(14, &chain(14), false);
    assert_eq!(asked.len(), 13, "{asked:?}");
    assert!(asked.contains(&vec!["q[3]".to_string(), "q[4]".to_string()]), "{asked:?}");
    assert_eq!(pairs(14, &chain(14), true).len(), 14 * 13 / 2);
    assert_eq!(pairs(5, &chain(5), false).len(), 5 * 4 / 2);
    let everywhere = "sum((q[i] - q[j])^2/2 for i in 1..12, j in 1..12 where i < j)";
    assert_eq!(pairs(12, everywhere, false).len(), 12 * 11 / 2);
}

#[test]
fn longer_segments_and_gaps_change_nothing() {
    let graph = Graph::chain(16);
    let times: Vec<f64> = (0..6).map(|i| 0.15 * f64::from(i)).collect();
    let mut data = graph.measured(40, &times, 0.01);
    for (at, run) in data.runs.iter_mut().enumerate() {
        run.values[at % 32][at % 6] = f64::NAN;
        run.values[(7 * at + 3) % 32][(at + 2) % 6] = f64::NAN;
    }
    let window = |options: Options| Options { window: Some(6), ..options };
    let sparse = graph.learn(&data, &window(sparse()));
    let dense = graph.learn(&data, &window(dense()));
    assert!(went_sparse(&sparse) && !went_sparse(&dense));
    assert_same(&sparse, &dense);
}

#[test]
fn a_hundred_masses_are_found_whatever_the_threads() {
    let graph = Graph::chain(100);
    let data = graph.measured(150, &[0.0, 0.1], 0.002);
    let learn = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads").install(|| graph.learn(&data, &Options::default()))
    };
    let model = learn(1);
    assert!(went_sparse(&model));
    assert_eq!(model.terms.len(), graph.terms());
    assert!(model.evidence.error > 0.97 && model.evidence.error < 1.03);
    assert!(model.terms.iter().all(|term| term.inclusion.is_some_and(|part| part > 0.9)));
    assert_eq!(learn(2), model);
}

#[test]
fn what_is_coupled_to_all_goes_by_the_dense_factor() {
    let mut graph = Graph { degrees: 12, edges: Vec::new() };
    for a in 1..12 {
        graph.edges.extend((a + 1..=12).map(|b| (a, b)));
    }
    let data = graph.measured(120, &[0.0, 0.1], 0.002);
    assert!(!went_sparse(&graph.learn(&data, &Options::default())));
}

#[test]
fn masses_that_are_alike_have_one_coefficient() {
    let n = 40;
    let header = format!("coordinates q[1..{n}]\nmomenta p[1..{n}]\n");
    let truth = format!(
        "{header}T = sum(0.45*p[i]^2 for i in 1..{n})\n\
         V = sum(0.6*(q[i+1] - q[i])^2 for i in 1..{})\n",
        n - 1
    );
    let law = build("truth", &truth).unwrap_or_else(|error| panic!("{error}"));
    let mut generator = Pcg64::seed_from_u64(5);
    let starts: Vec<Vec<f64>> =
        (0..200).map(|_| (0..2 * n).map(|_| generator.random_range(-1.0..1.0)).collect()).collect();
    let motion = Simulator::known(&law.system).trajectories(&starts, &[0.0, 0.1]);
    let mut data = motion.unwrap_or_else(|error| panic!("{error}")).dataset(&law.system);
    let noise = vec![NoiseLevel::Absolute(0.004); data.observables.len()];
    add_noise(&mut data, &noise, 3).expect("a positive sigma");
    let space = format!(
        "{header}T = span{{ p[i]^2 for i in 1..{n} alike }}\n\
         V = span{{ (q[i+1] - q[i])^2 for i in 1..{} alike, poly(q[i]; 4) for i in 1..{n} alike }}\n",
        n - 1
    );
    let space = build("space", &space).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(space.system.terms.len(), 6);
    let learn = |options: &Options| {
        fit(&space.system, &data, options, &Silent).unwrap_or_else(|error| panic!("{error}"))
    };
    let (sparse, dense) = (learn(&sparse()), learn(&dense()));
    assert!(went_sparse(&sparse) && !went_sparse(&dense));
    assert_eq!(sparse.terms.len(), 2);
    for (term, truth) in sparse.terms.iter().zip([0.45, 0.6]) {
        assert!((term.coefficient - truth).abs() < 5.0 * term.standard_error, "{term:?}");
    }
    assert_same(&sparse, &dense);
}

#[test]
fn what_couples_all_or_ends_is_said_before_a_fit() {
    let said = |springs: &str| {
        let spec = format!(
            "coordinates q[1..20]\nmomenta p[1..20]\n\
             T = span{{ p[i]^2 for i in 1..20 }}\nV = span{{ {springs} }}\n"
        );
        let space = build("couplings", &spec).unwrap_or_else(|error| panic!("{error}"));
        FunctionSpace::new(&space).couplings.join(" ")
    };
    let all = said("(q[i] - q[j])^2 for i in 1..20, j in 1..20 where i < j");
    assert!(all.contains("210 terms for 190 pairs"), "{all}");
    let chain = said("(q[i+1] - q[i])^2 for i in 1..19");
    assert!(chain.contains("Fewer at `q[1]`, `q[20]`"), "{chain}");
    let ring = said("(q[i+1] - q[i])^2 for i in 1..19, (q[1] - q[20])^2");
    assert_eq!(ring, "20 pairs of 20 coordinates, most with 2 others.");
}
