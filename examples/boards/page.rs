//! The page that the boards make: figures of others, ours, and a line for every case.

use std::fmt::Write as _;

use super::boards::{ODEBENCH, OSCILLATORS};
use super::record::{Record, State};

/// A motion is predicted where its normalised mean squared error is below.
const PREDICTED: (f64, f64) = (1e-3, 1e-2);

/// A row of figures that others published, over the noises of the board.
struct Published {
    who: &'static str,
    source: &'static str,
    /// By noise in per cent; empty where nothing was published.
    figures: [&'static str; 3],
}

/// The noises of the published figures.
const NOISES: [f64; 3] = [0.0, 1.0, 5.0];

/// Of the forty-four oscillators, those whose law has the terms of the truth.
const OSCILLATOR_FIGURES: &[Published] = &[
    Published {
        who: "FunctionEvolve with Opus 4.6, its top one",
        source: "arXiv 2606.07704",
        figures: ["34 of 44", "14 of 44", "5 of 44"],
    },
    Published {
        who: "the same without a language model",
        source: "the same",
        figures: ["5 of 44", "", ""],
    },
    Published {
        who: "LLM-SR with the same model",
        source: "the same",
        figures: ["0 of 44", "", ""],
    },
];

const ODE_FIGURES: &[Published] = &[Published {
    who: "LLM-ACES, which may ask for further motions; exact, of all 63 systems",
    source: "as published",
    figures: ["46.2 %", "", ""],
}];

const HEAD: &str = "# Boards: systems that others defined

Lists of laws that others defined, and what others reached on them. Motions are made from each law by
an integrator that is not the library's own, and `discover` is asked for the law: on one thread, with
its defaults, held out what the program holds out by itself (a share of 0.25; of two runs one). This
page is made by

```console
$ cargo run --release --example boards -- --oscillators FILE --odebench FILE
```

The lists are not part of this project. Every case is a line of a file; a run that was ended goes on,
and `--page` makes the page of what there is.

**The same terms**: both accelerations are expanded into additive terms; every one of the truth has its
one in the law, and none is there beside. Terms are one where they are proportional at random points;
terms with fitted numbers inside where they have the same functions and, scaled, differ by less than
5 % of their size. Sine and cosine of one frequency are one wave, and its phase is a fitted number.
**Beside** counts members of the law that are not in the truth, **without** those of the truth that the
law lacks. **Named beside**: those that it lacks and that stand in a form which the program names as
explaining the data as well. **Explained**: the last diagnosis says that what is left is noise. Seconds are of processor
time, for all fits and diagnoses of the case.
";

const OSCILLATORS_HEAD: &str = "
## Oscillators

The physical oscillators of LLM-SRBench, x'' = acceleration(x, v, t). Six runs from starts that are
uniform in (-1.5, 1.5) x (-1.5, 1.5), t from 0 to 20 in 300 samples of x and v; a start whose motion leaves every
bound is drawn anew up to ten times. Noise is in parts of each column's spread. The spec says `T = v^2/2`,
`V = span{ poly(x; 4) }` and nothing else. Six new motions begin within the range of the starts, and six
beyond it by up to 1.5 times; printed is the mean squared error over the variance, of the worse column, and it
counts as predicted below 1e-3 within and below 1e-2 beyond.

**The others are given exact accelerations at points, without trajectories; we are given trajectories,
without accelerations.** In seven of the forty-four (2, 5, 11, 20, 28, 33, 34) the others' own truth
misses their published far-away samples.
";

const ODE_HEAD: &str = "
## ODEBench, mechanical systems

The systems of second order in ODEBench: 150 samples from 0 to 10 from each of its two starts. The spec
knows `T = v^2/2` and a part of V. Right is a case in which exactly the missing effects are named, the
law has the terms of the truth, and it is explained. What others published is of all systems of
the set, most of which are not mechanical.
";

/// The page of all cases.
pub(crate) fn page(mut records: Vec<Record>) -> String {
    records.sort_by(|a, b| {
        let key = |record: &Record| (number_in(&record.system), record.system.clone());
        key(a).cmp(&key(b)).then(a.noise.total_cmp(&b.noise))
    });
    let of = |board: &str| -> Vec<&Record> {
        records.iter().filter(|record| record.board == board).collect()
    };
    let (oscillators, odes) = (of(OSCILLATORS), of(ODEBENCH));
    let mut out = String::from(HEAD);
    if !oscillators.is_empty() {
        out.push_str(OSCILLATORS_HEAD);
        figures(&mut out, "the same terms", OSCILLATOR_FIGURES, &oscillators, Record::is_exact);
        summary(&mut out, &oscillators);
        predictions(&mut out, &oscillators);
        lines(&mut out, &oscillators, false);
    }
    if !odes.is_empty() {
        out.push_str(ODE_HEAD);
        figures(&mut out, "right", ODE_FIGURES, &odes, |one| one.named == Some(true));
        summary(&mut out, &odes);
        lines(&mut out, &odes, true);
    }
    out
}

/// The first number in a name, by which systems are in order.
fn number_in(name: &str) -> u64 {
    let digits = name.chars().skip_while(|c| !c.is_ascii_digit());
    digits.take_while(char::is_ascii_digit).collect::<String>().parse().unwrap_or(0)
}

/// The noises of some cases, in order.
fn noises(records: &[&Record]) -> Vec<f64> {
    let mut all: Vec<f64> = records.iter().map(|record| record.noise).collect();
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

fn at<'a>(records: &[&'a Record], noise: f64) -> Vec<&'a Record> {
    records.iter().copied().filter(|record| record.noise == noise).collect()
}

/// Figures of others, and ours below.
fn figures(
    out: &mut String,
    what: &str,
    published: &[Published],
    records: &[&Record],
    is_hit: impl Fn(&Record) -> bool,
) {
    let _ =
        writeln!(out, "\n| who: {what} | source | no noise | 1 % | 5 % |\n|---|---|---|---|---|");
    for row in published {
        let _ = writeln!(out, "| {} | {} | {} |", row.who, row.source, row.figures.join(" | "));
    }
    let ours = NOISES.map(|noise| {
        let here = at(records, noise);
        let hits = here.iter().filter(|record| is_hit(record)).count();
        match here.len() {
            0 => String::new(),
            count => format!("{hits} of {count}"),
        }
    });
    let _ = writeln!(out, "| Leverrier, from trajectories | this page | {} |", ours.join(" | "));
}

/// What became of all cases of one noise.
fn summary(out: &mut String, records: &[&Record]) {
    out.push_str(
        "\n| noise | cases | the same terms | of these explained | explained, a member not in the truth \
         | what they lack named beside them | explained, a term short | unexplained | too little data | not finished | not made | failed \
         | median s | longest s |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for noise in noises(records) {
        let here = at(records, noise);
        let count = |is: &dyn Fn(&Record) -> bool| here.iter().filter(|one| is(one)).count();
        let state = |state: State| count(&|one| one.state == state);
        let other = |verdict: &str| {
            count(&|one| one.state == State::Done && !one.is_exact() && one.verdict == verdict)
        };
        let explained = |one: &Record| one.is_explained() && !one.is_exact();
        let cells = [
            here.len(),
            count(&Record::is_exact),
            count(&|one| one.is_exact() && one.is_explained()),
            count(&|one| explained(one) && one.beside > 0),
            count(&|one| explained(one) && one.beside > 0 && one.names_the_truth()),
            count(&|one| explained(one) && one.beside == 0),
            other("unexplained"),
            other("too little data"),
            state(State::NotFinished),
            state(State::NotMade),
            state(State::Failed),
        ];
        let cells: Vec<String> = cells.iter().map(usize::to_string).collect();
        let ran = here.iter().filter(|one| matches!(one.state, State::Done | State::NotFinished));
        let mut seconds: Vec<f64> = ran.map(|one| one.seconds).collect();
        seconds.sort_by(f64::total_cmp);
        let cut = here.iter().any(|one| one.state == State::NotFinished);
        let median = seconds.get(seconds.len().saturating_sub(1) / 2);
        let median = median.map_or("-".to_string(), |s| format!("{s:.1}"));
        let longest = match seconds.last() {
            Some(most) if cut => format!("above {most:.0}"),
            Some(most) => format!("{most:.1}"),
            None => "-".to_string(),
        };
        let _ = writeln!(out, "| {noise} % | {} | {median} | {longest} |", cells.join(" | "));
    }
}

/// How many new motions are predicted.
fn predictions(out: &mut String, records: &[&Record]) {
    out.push_str("\n| noise | predicted within | predicted beyond |\n|---|---|---|\n");
    for noise in noises(records) {
        let here = at(records, noise);
        let share = |error: fn(&Record) -> Option<f64>, below: f64| {
            let hits = here.iter().filter(|one| error(one).is_some_and(|e| e < below)).count();
            format!("{hits} of {}", here.len())
        };
        let within = share(|one| one.within, PREDICTED.0);
        let beyond = share(|one| one.beyond, PREDICTED.1);
        let _ = writeln!(out, "| {noise} % | {within} | {beyond} |");
    }
}

/// One line per system and noise.
fn lines(out: &mut String, records: &[&Record], is_ode: bool) {
    out.push_str(match is_ode {
        true => {
            "\n| system | noise | right | the same terms | without | named beside | beside | verdict | s \
             | added | terms |\n|---|---|---|---|---|---|---|---|---|---|---|\n"
        }
        false => {
            "\n| system | noise | the same terms | without | named beside | beside | verdict | within \
             | beyond | s | added | terms |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n"
        }
    });
    for record in records {
        let yes = |is: bool| if is { "yes" } else { "no" };
        let error = |error: Option<f64>| error.map_or("-".to_string(), |e| format!("{e:.1e}"));
        let _ = write!(out, "| {} | {} % |", record.system, record.noise);
        if record.state != State::Done {
            let (what, seconds) = match record.state {
                State::NotFinished => ("not finished", format!("above {:.0}", record.seconds)),
                State::NotMade => ("leaves every bound", String::new()),
                _ => ("failed", String::new()),
            };
            // Right, the same terms, without, beside; then the errors.
            let (blank, errors) = if is_ode { (" | | | | |", "") } else { (" | | | |", " | |") };
            let remark = escaped(&record.remark);
            let _ = writeln!(out, "{blank} {what} |{errors} {seconds} | | {remark} |");
            continue;
        }
        if is_ode {
            let _ = write!(out, " {} |", yes(record.named == Some(true)));
        }
        let _ = write!(
            out,
            " {} | {} | {} | {} | {} |",
            yes(record.is_exact()),
            record.missing,
            record.level,
            record.beside,
            record.verdict
        );
        if !is_ode {
            let _ = write!(out, " {} | {} |", error(record.within), error(record.beyond));
        }
        let _ = writeln!(
            out,
            " {:.1} | {} | {} |",
            record.seconds,
            escaped(&record.added),
            escaped(&record.remark)
        );
    }
}

/// A text inside a table, as code.
fn escaped(text: &str) -> String {
    match text.is_empty() {
        true => String::new(),
        false => format!("`{}`", text.replace('|', "/").replace('`', "'")),
    }
}
