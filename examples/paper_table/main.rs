//! Regenerates docs/paper-table.md, docs/henon-heiles.svg and docs/henon-heiles.csv: the
//! figures of DiPietro, Xiong and Zhu (2020) beside ours.
//!
//! ```console
//! $ cargo run --release --example paper_table
//! ```

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a benchmark that fails stops"
)]

#[allow(dead_code, reason = "the tests use the rest")]
#[path = "../../tests/learning/paper/mod.rs"]
mod paper;
mod picture;

use std::fmt::Write as _;
use std::time::Instant;

use leverrier::internals::dynamics::Method;
use leverrier::internals::fit::{Model, Options};
use paper::bound;
use paper::figures::{
    best_quintic, bytes, deviations, energy_stray, first_samples, fresh_starts, halves,
    largest_error, largest_in_standard_errors, one_step, pendulum_error, predict, printed,
    simplified,
};
use paper::{
    Law, PendulumSpace, SIGMA, STEP, coupled, coupled_clean, coupled_noisy, henon_heiles,
    henon_heiles_pairs, learn, learn_with, mass_spring, mass_spring_pairs, pairs, pendulum,
    pendulum_pairs, pendulum_space, tensor,
};

/// One line of the table.
struct Row {
    case: String,
    paper: &'static str,
    here: String,
    seconds: f64,
}

/// The rows as they come; each is printed when it is done.
#[derive(Default)]
struct Table {
    rows: Vec<Row>,
}

impl Table {
    fn row(&mut self, case: &str, paper: &'static str, figures: impl FnOnce() -> String) {
        let clock = Instant::now();
        let here = figures();
        let seconds = clock.elapsed().as_secs_f64();
        println!("{case}\n    paper: {paper}\n    here:  {here}\n    ({seconds:.1} s)");
        self.rows.push(Row { case: case.to_string(), paper, here, seconds });
    }
}

/// Rounding is rounding: the last digits differ from machine to machine.
fn rounded(error: f64) -> String {
    if error < 1e-12 { "below 1e-12".to_string() } else { format!("{error:.1e}") }
}

fn exact(law: &Law, model: &Model) -> &'static str {
    if deviations(law, model).is_some() { "exact support" } else { "support not exact" }
}

fn main() -> std::io::Result<()> {
    let mut table = Table::default();
    henon_heiles_rows(&mut table);
    coupled_rows(&mut table);
    mass_spring_rows(&mut table);
    pendulum_rows(&mut table);
    other_rows(&mut table);
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    prediction(&mut table, &root)?;
    let page = page(&table);
    println!("\n{page}");
    std::fs::write(root.join("paper-table.md"), page)
}

fn henon_heiles_rows(table: &mut Table) {
    let law = henon_heiles();
    for degree in [3, 6, 10] {
        table.row(&format!("Hénon-Heiles, clean, degree {degree}"), "1e-5", || {
            let model = learn(&tensor(degree), &henon_heiles_pairs(5_000, 0.0, 1));
            format!(
                "{}, coefficients {}",
                exact(&law, &model),
                rounded(largest_error(&law, &model))
            )
        });
    }
    for degree in [3, 6, 10] {
        table.row(&format!("Hénon-Heiles, noise 0.005, degree {degree}"), "1e-1", || {
            let model = learn(&tensor(degree), &henon_heiles_pairs(5_000, SIGMA, 1));
            format!(
                "{}, coefficients {:.1e} or {:.1} standard errors",
                exact(&law, &model),
                largest_error(&law, &model),
                largest_in_standard_errors(&law, &model)
            )
        });
    }
    table.row("the same at degree 3, 50 seeds", "not given", || {
        let (space, plain) = (tensor(3), bound::henon_heiles());
        let (mut squares, mut covered, mut count, mut found) = (0.0, 0, 0, 0);
        for seed in 0..50 {
            let starts = first_samples(&henon_heiles_pairs(5_000, 0.0, seed));
            let least = plain.covariance(&starts, 2, SIGMA);
            let model = learn(&space, &henon_heiles_pairs(5_000, SIGMA, seed));
            let Some(errors) = deviations(&law, &model) else { continue };
            found += 1;
            for (k, (error, width)) in errors.into_iter().enumerate() {
                squares += error * error / least[(k, k)];
                covered += usize::from(error.abs() < 1.959964 * width);
                count += 1;
            }
        }
        format!(
            "exact support in {found} of 50; mean squared error {:.2} times the Cramér-Rao bound; \
             95 % intervals cover {:.0} %",
            squares / f64::from(count),
            100.0 * covered as f64 / f64::from(count)
        )
    });
}

fn coupled_rows(table: &mut Table) {
    let law = coupled();
    table.row("coupled, 500 clean", "1e-6; one step 2e-8", || {
        let (space, data) = (tensor(3), coupled_clean(1));
        let model = learn(&space, &data);
        let ahead = one_step(&law, &space, &model, &fresh_starts(&law, 200, 77));
        format!(
            "{}, coefficients {}; one step {}",
            exact(&law, &model),
            rounded(largest_error(&law, &model)),
            rounded(ahead.iter().fold(0.0, |most, e| most.max(*e)))
        )
    });
    let cases = [
        (3, 20, "q 6.6e-4, p 5.6e-4"),
        (6, 20, "q 8.9e-4, p 9.7e-4"),
        (10, 20, "q 3.8e-3, p 3.1e-3"),
    ];
    for (degree, seeds, figure) in cases {
        table.row(&format!("coupled, 200 noisy, degree {degree}"), figure, || {
            let (space, plain) = (tensor(degree), bound::coupled());
            let starts = fresh_starts(&law, 200, 991);
            let (mut ours, mut least, mut found) = (vec![0.0; 4], vec![0.0; 4], 0);
            for seed in 0..seeds {
                let clean = first_samples(&coupled_noisy(0.0, seed));
                let covariance = plain.covariance(&clean, 4, SIGMA);
                let model = learn(&space, &coupled_noisy(SIGMA, seed));
                found += u64::from(deviations(&law, &model).is_some());
                let parts = one_step(&law, &space, &model, &starts);
                let bounds = plain.one_step(&starts, &covariance);
                for k in 0..4 {
                    ours[k] += parts[k] / seeds as f64;
                    least[k] += bounds[k] / seeds as f64;
                }
            }
            let ((q, p), (least_q, least_p)) = (halves(&ours), halves(&least));
            format!(
                "exact support in {found} of {seeds}; one step q {q:.1e}, p {p:.1e} (Cramér-Rao \
                 bound {least_q:.1e}, {least_p:.1e})"
            )
        });
    }
}

fn mass_spring_rows(table: &mut Table) {
    let law = mass_spring(1);
    for degree in [2, 4, 6] {
        let case = format!("mass-spring, clean, degree {degree}");
        table.row(&case, "structure only", || {
            let (space, data) = (pairs(degree), mass_spring_pairs(&law, 0.0, 1));
            let model = learn(&space, &data);
            let springs = printed(&space, &model, &data).matches(")^2").count();
            format!(
                "{}, coefficients {}; printed with {springs} squares of differences",
                exact(&law, &model),
                rounded(largest_error(&law, &model))
            )
        });
    }
    for degree in [2, 4, 6] {
        let case = format!("mass-spring, noise 0.005, degree {degree}");
        table.row(&case, "structure only", || {
            let (space, data) = (pairs(degree), mass_spring_pairs(&law, SIGMA, 1));
            let model = learn(&space, &data);
            let starts = first_samples(&mass_spring_pairs(&law, 0.0, 1));
            let (q, p) = halves(&one_step(&law, &space, &model, &starts));
            format!(
                "{}; one step q {q:.1e}, p {p:.1e}; {} exchanges of terms named that these data \
                 can hardly tell apart",
                exact(&law, &model),
                model.alternatives.len()
            )
        });
    }
    table.row("the same at degree 2, 10 sets of masses and springs", "not given", || {
        let space = pairs(2);
        let exact = (1..=10).filter(|&seed| {
            let law = mass_spring(seed);
            deviations(&law, &learn(&space, &mass_spring_pairs(&law, SIGMA, seed))).is_some()
        });
        let found = exact.count();
        format!("exact support in {found} of 10: 800 noisy pairs of one slow motion are few")
    });
}

fn pendulum_rows(table: &mut Table) {
    let data = pendulum_pairs();
    let cases = [
        (PendulumSpace::Sine, "pendulum, sine", "1e-4"),
        (PendulumSpace::Mixed, "pendulum, mixed space", "wrong V"),
    ];
    for (which, case, figure) in cases {
        table.row(case, figure, || {
            let space = pendulum_space(&which);
            let model = learn(&space, &data);
            let error = pendulum_error(&model).map_or("not the true V".to_string(), |e| {
                format!("the true V, its numbers {}", rounded(e))
            });
            format!("{error}; printed `{}`", printed(&space, &model, &data))
        });
    }
    table.row("pendulum, polynomials only", "7e-5 a step", || {
        let space = pendulum_space(&PendulumSpace::Polynomial);
        let model = learn(&space, &data);
        let ahead = one_step(&pendulum(), &space, &model, &first_samples(&data));
        let shapes = simplified(&space, &model, &data).parts.into_iter().flat_map(|p| p.shape);
        format!(
            "q {:.1e}, p {:.1e} a step (no quintic can do better than {:.1e} in p); \"{}\"",
            ahead[0],
            ahead[1],
            best_quintic(&data),
            shapes.collect::<Vec<_>>().join("; ")
        )
    });
}

fn other_rows(table: &mut Table) {
    let law = henon_heiles();
    table.row("learned parameters, size", "32 to 390 (its rivals 3,072 to 1,051,648)", || {
        let sizes = [3, 6, 10].map(|degree| {
            let space = tensor(degree);
            let model = learn(&space, &henon_heiles_pairs(1_000, SIGMA, 1));
            let (_, needed) = bytes(&model);
            format!("{} of {} ({needed} bytes)", model.evidence.learned, space.terms.len())
        });
        format!("Hénon-Heiles, degree 3, 6, 10: {}", sizes.join(", "))
    });
    table.row("RK4 in place of the symplectic integrator", "1e4 times worse (faulty RK4)", || {
        let space = tensor(3);
        let with = |name: &str| {
            let method = Method::by_name(name).expect("a row of METHODS");
            let options =
                Options { method: Some(method), longest_step: Some(STEP), ..Options::default() };
            let model = learn_with(&space, &henon_heiles_pairs(5_000, 0.0, 1), &options);
            let error = model.terms.iter().map(|term| {
                let known = law.terms.iter().find(|(p, t, _)| *p == term.place && *t == term.term);
                (term.coefficient - known.map_or(0.0, |row| row.2)).abs()
            });
            let start = [0.0, 0.1, 0.4, 0.2];
            (error.fold(0.0, f64::max), energy_stray(&law, &space, &model, method, &start, 1e4))
        };
        let ((rk4, rk4_stray), (splitting, stray)) = (with("rk4"), with("forest-ruth"));
        format!(
            "one step of 0.1 a pair, both of order 4: coefficients {rk4:.1e} with RK4, \
             {splitting:.1e} with Forest-Ruth ({:.2} times); energy astray after t = 10,000: \
             {rk4_stray:.1e} and {stray:.1e} ({:.0} times)",
            rk4 / splitting,
            rk4_stray / stray
        )
    });
}

fn prediction(table: &mut Table, docs: &std::path::Path) -> std::io::Result<()> {
    let (space, law) = (tensor(3), henon_heiles());
    let model = learn(&space, &henon_heiles_pairs(5_000, SIGMA, 1));
    let start = vec![-0.48, -0.02, -0.08, 0.18];
    let times: Vec<f64> = (0..=400).map(|i| 0.02 * f64::from(i)).collect();
    let both = predict(&law, &space, &model, &[start], &times);
    let mut csv =
        String::from("t,q1_true,q2_true,q1_learned,q2_learned,energy_true,energy_learned\n");
    for (i, time) in times.iter().enumerate() {
        let (truth, learned) = (&both.truth[0][i], &both.learned[0][i]);
        let (before, after) = (both.true_energy[0][i], both.learned_energy[0][i]);
        let _ = writeln!(
            csv,
            "{time:.2},{:.6},{:.6},{:.6},{:.6},{before:.8},{after:.8}",
            truth[0], truth[1], learned[0], learned[1]
        );
    }
    std::fs::write(docs.join("henon-heiles.csv"), csv)?;
    std::fs::write(docs.join("henon-heiles.svg"), picture::draw(&times, &both))?;
    let far = both.truth[0].iter().zip(&both.learned[0]);
    let far = far.flat_map(|(a, b)| a.iter().zip(b).map(|(x, y)| (x - y).abs()));
    let far = far.fold(0.0, f64::max);
    let energy = both.learned_energy[0].iter().zip(&both.true_energy[0]);
    let energy = energy.map(|(a, b)| ((a - b) / b).abs()).fold(0.0, f64::max);
    table.row(
        "trained on noise, predicted from q = (-0.48, -0.02), p = (-0.08, 0.18) to t = 8",
        "follows, deviates in the last steps",
        || {
            format!(
                "follows to t = 8: largest error {far:.1e}, energy within {:.1} % \
                 (docs/henon-heiles.csv)",
                100.0 * energy
            )
        },
    );
    Ok(())
}

fn page(table: &Table) -> String {
    let mut page = String::from(
        "# The paper's figures and ours\n\n\
         DiPietro, Xiong and Zhu, *Sparse Symplectically Integrated Neural Networks*, NeurIPS \
         2020. Data as the paper makes them, the same defaults for every system; noise has a \
         standard deviation of 0.005 in every number of every sample. Regenerate with\n\n\
         ```console\n$ cargo run --release --example paper_table\n```\n\n\
         Coefficients: largest absolute error. One step: mean absolute error 0.1 ahead from clean \
         starts. Times are of one machine with two busy cores and cover all fits of the row, \
         the making of the data included.\n\n\
         | case | paper | here | time, s |\n|---|---|---|---|\n",
    );
    for row in &table.rows {
        let here = row.here.replace('|', "\\|");
        let _ = writeln!(page, "| {} | {} | {here} | {:.1} |", row.case, row.paper, row.seconds);
    }
    page
}
