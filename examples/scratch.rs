use leverrier::data::{Dataset, Run};
use leverrier::dynamics::*;
use leverrier::eval::Backend;
use leverrier::expr::*;
use leverrier::fit::{monitor::Silent, options::Options, train::train};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;

fn tensor(n: usize, degree: usize) -> System {
    let mut g = Graph::new();
    let mut terms = vec![];
    for (place, mom) in [(Place::Kinetic, true), (Place::Potential, false)] {
        for a in 0..=degree {
            for b in 0..=degree {
                if a + b == 0 {
                    continue;
                }
                let s = |i| if mom { Symbol::Momentum(i) } else { Symbol::Coordinate(i) };
                let x = g.symbol(s(0));
                let y = g.symbol(s(1));
                let e = g.product(1.0, &[(x, a as f64), (y, b as f64)]);
                terms.push(Term {
                    place,
                    expr: e,
                    label: format!("{}1^{a} {0}2^{b}", if mom { "p" } else { "q" }),
                    name: None,
                    bounds: Bounds::FREE,
                    unit: None,
                    unit_text: None,
                });
            }
        }
    }
    let zero = g.number(0.0);
    let v = |s: &str| Variable { name: s.into(), unit: None, unit_text: None };
    System {
        name: "t".into(),
        graph: g,
        coordinates: (0..n).map(|i| v(&format!("q{i}"))).collect(),
        momenta: (0..n).map(|i| v(&format!("p{i}"))).collect(),
        observed: Observed::Momenta,
        velocities: vec![],
        time: v("t"),
        parameters: vec![],
        kinetic: zero,
        potential: zero,
        hamiltonian: zero,
        forces: vec![zero; n],
        terms,
    }
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let degree: usize = args[1].parse().unwrap();
    let sigma: f64 = args[2].parse().unwrap();
    let seeds: u64 = args[3].parse().unwrap();
    let hh = systems::SYSTEMS.iter().find(|s| s.name.contains("enon")).unwrap();
    let truth = (hh.build)();
    let dynamics = Dynamics::new(&truth, &[], Backend::Batched);
    for seed in 0..seeds {
        let mut rng = Pcg64::seed_from_u64(seed);
        let noise = Normal::new(0.0, sigma).unwrap();
        let mut runs = vec![];
        let mut scratch = Scratch::new();
        let method = Method::by_name("suzuki-umeno-8").unwrap();
        while runs.len() < 5000 {
            let z: Vec<f64> = (0..4).map(|_| rng.random_range(-1.0..1.0)).collect();
            if z[1] < -0.5 {
                continue;
            }
            let mut b = Batch::new(2, 1);
            b.set(0, 0.0, &z);
            let mut e = [0.0];
            dynamics.energy(&b, &[], &mut e, &mut scratch);
            if e[0] < 1.0 / 12.0 || e[0] > 1.0 / 6.0 {
                continue;
            }
            advance(&dynamics, method, &mut b, &[0.1], 4, &[], &mut scratch);
            let z1 = b.get(0);
            let values = (0..4)
                .map(|i| vec![z[i] + noise.sample(&mut rng), z1[i] + noise.sample(&mut rng)])
                .collect();
            runs.push(Run {
                name: format!("{}", runs.len()),
                times: vec![0.0, 0.1],
                values,
                lines: vec![0, 0],
            });
        }
        let data =
            Dataset { observables: vec!["q1".into(), "q2".into(), "p1".into(), "p2".into()], runs };
        let system = tensor(2, degree);
        let options = Options::default();
        let t = std::time::Instant::now();
        let model = leverrier::fit::fit(&system, &data, &options, &Silent).unwrap();
        if seeds > 3 {
            println!(
                "{seed} {:?} {:?}",
                t.elapsed(),
                model
                    .terms
                    .iter()
                    .map(|t| (t.term.clone(), t.coefficient, t.standard_error))
                    .collect::<Vec<_>>()
            );
            continue;
        }
        println!(
            "{}",
            serde_json::to_string_pretty(&model)
                .unwrap()
                .lines()
                .take(120)
                .collect::<Vec<_>>()
                .join("\n")
        );
        let (m, round) = train(&system, &data, &options, &Silent).unwrap();
        println!(
            "seed {seed}: {:?} rounds {} tried {} refit it {} {:?} exploded {} rows {}",
            t.elapsed(),
            m.rounds,
            round.search.tried,
            round.refit.iterations,
            round.refit.stop,
            round.refit.sums.exploded,
            round.refit.sums.rows
        );
        println!("  noise {:?} resolution {:?} {:?}", m.noise, m.resolution, m.stepping);
        for &k in &m.support {
            println!("   {} {:.12}", system.terms[k].label, m.coefficients[k]);
        }
    }
}
