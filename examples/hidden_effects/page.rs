//! The page that the benchmark makes of its results.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::hidden::design::{Kind, NOISES, PERIODS, REACHES};
use super::hidden::score::{Mark, Member, Record};

/// Half the width of the interval that holds 95 % of a normal number, in standard errors.
const NINETY_FIVE: f64 = 1.959_964;

/// The whole page of some cases of a design of `all`.
pub(crate) fn page(records: &[Record], all: usize) -> String {
    let mut out = format!(
        "{HEAD}\n**On this page: {} of the {all} cases of the design.** Any first part of it is a sample of \
         the whole, but short runs take less time: here are {}.\n",
        records.len(),
        PERIODS.map(|periods| parts(records, periods)).join(", "),
    );
    figures(&mut out, records);
    for (title, of) in FACTORS {
        by(&mut out, records, title, *of);
    }
    marks(&mut out, records);
    seconds(&mut out, records);
    wrong(&mut out, records);
    rows(&mut out, records);
    out
}

const HEAD: &str = "# Hidden effects

Something is hidden in simulated measurements of a known system, or nothing, and the diagnosis is asked
what is missing. `cargo run --release --example hidden_effects` makes this page; every case is a line of a
file, a run that was ended goes on, `--page` makes the page of what there is, `--case 17` runs one case
and tells all about it.

A case is drawn from the product of

- what is hidden: nothing (a quarter of the cases), one effect (a third; every row of the catalogue), two or
  three, one effect with one coefficient on several coordinates or on a body, a wrong known number, a term
  that has to be composed, a stranger (a partner that moves and that nobody measures, a memory, a delay);
- its strength: it moves the samples by 0.02, 0.2, 1 or 2 of their spread, or as far as it can move them;
- noise of 0, 0.1, 1 and 5 % of each column's spread: white (half of the cases), correlated, rounded to the
  instrument's steps, or with velocities that are filtered differences of the noisy positions;
- runs of 5 to 200 turns of a unit oscillator, 8 runs to 2, with 32 samples a turn to 8;
- what the spec knows: all numbers, half of them, none;
- what is seen: states, positions alone, irregular times with gaps and lost cells, one long run;

with the levels of every factor equally often, shuffled. A quarter of the runs (of a long run: of its
samples) is held out.

**Identifiable** is what the data can tell: with the true terms in the model, all numbers fitted over whole
runs and weighed by the true noise, twice the log-likelihood grows by more than 25 (five standard
deviations) and the price of the unknowns (their number times the logarithm of that of the readings); of
several members by that much for each; correlated noise counts as the fewer independent readings that say
as much. A stranger has no terms: there the model as it is must leave
more than noise. What was not finished, or could not be weighed, counts as identifiable.

**Right** is strict: the names and coordinates of what is hidden and no other, and every number within five
of its standard errors, or, without noise, right to one part in a million. **Equal** are stories with another name that fit training runs and held-out runs
as well as the truth does (a deviance less than 6 higher, held-out errors within 1 %), or that the program
says it cannot tell from the true one. **Wrong** are all other stories. In filtered velocities, a shifted
clock of the momentum is there, and counts as nothing.
";

/// How many cases have so many turns in a run, and up to where in the design.
fn parts(records: &[Record], periods: f64) -> String {
    let here = || records.iter().filter(|one| one.periods == periods);
    match here().map(|one| one.number).max() {
        Some(last) => {
            let last = last + 1;
            format!(
                "{} with runs of {periods} turns (of the first {last} of the design)",
                here().count()
            )
        }
        None => format!("none with runs of {periods}"),
    }
}

/// A share of some cases.
struct Share {
    hits: usize,
    of: usize,
}

impl Share {
    fn of<'a>(records: impl Iterator<Item = &'a Record>, hit: impl Fn(&Record) -> bool) -> Share {
        let (mut hits, mut of) = (0, 0);
        for record in records {
            of += 1;
            hits += usize::from(hit(record));
        }
        Share { hits, of }
    }

    fn text(&self) -> String {
        match self.of {
            0 => "-".to_string(),
            of => format!("{:.1} %", 100.0 * self.hits as f64 / of as f64),
        }
    }
}

fn is_right(record: &Record) -> bool {
    record.mark() == Mark::Right
}

fn is_good(record: &Record) -> bool {
    matches!(record.mark(), Mark::Right | Mark::Equal)
}

fn is_wrong(record: &Record) -> bool {
    matches!(record.mark(), Mark::Wrong | Mark::Beside)
}

/// The goals and what was measured.
fn figures(out: &mut String, records: &[Record]) {
    out.push_str(
        "\n## Figures\n\n| figure | goal | measured | with equal ones | cases |\n\
         |---|---|---|---|---|\n",
    );
    let found = |kind: Kind| records.iter().filter(move |one| one.is(kind) && one.identifiable());
    let mut row = |what: &str, goal: &str, strict: Share, with_equal: Option<Share>| {
        let with_equal = with_equal.map_or_else(String::new, |share| share.text());
        let _ =
            writeln!(out, "| {what} | {goal} | {} | {with_equal} | {} |", strict.text(), strict.of);
    };
    for (noise, goal) in NOISES.into_iter().zip(["", "98 %", "98 %", "95 %"]) {
        let here = || found(Kind::Single).filter(|one| one.noise == noise);
        row(
            &format!("the right single effect first, identifiable, {} % noise", 100.0 * noise),
            goal,
            Share::of(here(), Record::first_is_right),
            Some(Share::of(here(), |one| one.first_is_right() || is_good(one))),
        );
    }
    for (kind, what, goal) in [
        (Kind::Single, "the whole story right, nothing beside it: one effect", "95 %"),
        (Kind::Pair, "... two effects", "90 %"),
        (Kind::Triple, "... three effects", "80 %"),
        (Kind::Composed, "composed terms: the true form or one equal to it", "80 %"),
        (Kind::Group, "groups named as such", "95 %"),
        (Kind::Number, "wrong numbers named as such", "95 %"),
    ] {
        let strict = if kind == Kind::Composed { is_good } else { is_right };
        row(what, goal, Share::of(found(kind), strict), Some(Share::of(found(kind), is_good)));
    }
    let nothing = || records.iter().filter(|one| one.is(Kind::Nothing));
    let named = Share::of(nothing(), |one| one.mark() == Mark::Wrong);
    row(
        &format!("nothing hidden, something named ({} of {})", named.hits, named.of),
        "0.2 %",
        named,
        None,
    );
    row(
        "stories with an effect that is not there, over all cases",
        "2 %",
        Share::of(records.iter(), is_wrong),
        None,
    );
    row(
        "strangers, identifiable: unexplained, nothing added",
        "95 %",
        Share::of(found(Kind::Stranger), |one| one.mark() == Mark::Unexplained),
        Some(Share::of(found(Kind::Stranger), |one| {
            matches!(one.mark(), Mark::Unexplained | Mark::Equal)
        })),
    );
    let noisy = records.iter().filter(|one| one.noise > 0.0);
    for (what, white) in [("white noise", true), ("other noise", false)] {
        let here = noisy.clone().filter(|one| (one.colour == "white") == white);
        let all: Vec<f64> = here.flat_map(Record::deviations).collect();
        let inside = all.iter().filter(|off| **off <= NINETY_FIVE).count();
        let share = Share { hits: inside, of: all.len() };
        row(
            &format!("95 % intervals of what was found cover, {what} (numbers)"),
            if white { "92 to 98 %" } else { "" },
            share,
            None,
        );
    }
}

type Factor = fn(&Record) -> String;

const FACTORS: &[(&str, Factor)] = &[
    ("strength", |one| format!("{}", one.reach.0)),
    ("noise", |one| format!("{} %", 100.0 * one.noise)),
    ("kind of noise", |one| if one.noise > 0.0 { one.colour.clone() } else { "none".into() }),
    ("turns in a run", |one| format!("{}", one.periods)),
    ("known", |one| one.known.clone()),
    ("seen", |one| one.seen.clone()),
    ("system", |one| one.base.clone()),
];

/// One effect, and nothing, by the levels of a factor.
fn by(out: &mut String, records: &[Record], title: &str, of: Factor) {
    let _ = write!(
        out,
        "\n## By {title}\n\n| {title} | one effect | identifiable | of these right | or equal | \
         nothing, unexplained | wrong | nothing hidden | of these named |\n\
         |---|---|---|---|---|---|---|---|---|\n"
    );
    let mut levels: Vec<String> = Vec::new();
    let orders = REACHES.iter().map(|x| format!("{x}"));
    let orders = orders.chain(NOISES.iter().map(|x| format!("{} %", 100.0 * x)));
    let orders: Vec<String> = orders.chain(PERIODS.iter().map(|x| format!("{x}"))).collect();
    for record in records {
        let level = of(record);
        if !levels.contains(&level) {
            levels.push(level);
        }
    }
    let factor_order = |level: &String| {
        let of = match title {
            "strength" => &orders[..REACHES.len()],
            "noise" => &orders[REACHES.len()..REACHES.len() + NOISES.len()],
            "turns in a run" => &orders[REACHES.len() + NOISES.len()..],
            _ => &[],
        };
        of.iter().position(|other| other == level)
    };
    levels.sort_by(|a, b| factor_order(a).cmp(&factor_order(b)).then(a.cmp(b)));
    for level in levels {
        let here = || records.iter().filter(|one| of(one) == level);
        let single = || here().filter(|one| one.is(Kind::Single));
        let found = || single().filter(|one| one.identifiable());
        let nothing = || here().filter(|one| one.is(Kind::Nothing));
        let silent = |one: &Record| {
            matches!(one.mark(), Mark::Nothing | Mark::Unexplained | Mark::TooLittle)
        };
        let _ = writeln!(
            out,
            "| {level} | {} | {} | {} | {} | {} | {} | {} | {} |",
            single().count(),
            found().count(),
            Share::of(found(), is_right).text(),
            Share::of(found(), is_good).text(),
            Share::of(found(), silent).text(),
            Share::of(found(), is_wrong).text(),
            nothing().count(),
            Share::of(nothing(), |one| one.mark() == Mark::Wrong).hits,
        );
    }
}

/// What became of every kind.
fn marks(out: &mut String, records: &[Record]) {
    const MARKS: [Mark; 9] = [
        Mark::Right,
        Mark::Equal,
        Mark::Off,
        Mark::Beside,
        Mark::Unexplained,
        Mark::Nothing,
        Mark::TooLittle,
        Mark::Wrong,
        Mark::Unmade,
    ];
    out.push_str("\n## What became of every kind\n\nAll cases, identifiable or not.\n\n| hidden | cases | identifiable |");
    MARKS.iter().for_each(|mark| {
        let _ = write!(out, " {} |", mark.text());
    });
    let _ = writeln!(out, "\n|---|---|---|{}", "---|".repeat(MARKS.len()));
    for (kind, _) in Kind::SHARES {
        let here = || records.iter().filter(|one| one.is(kind));
        let _ = write!(out, "| {} | {} |", kind.text(), here().count());
        if kind == Kind::Nothing {
            out.push_str("  |");
        } else {
            let _ = write!(out, " {} |", here().filter(|one| one.identifiable()).count());
        }
        for mark in MARKS {
            let _ = write!(out, " {} |", here().filter(|one| one.mark() == mark).count());
        }
        out.push('\n');
    }
}

/// How long it took.
fn seconds(out: &mut String, records: &[Record]) {
    out.push_str(
        "\n## Seconds\n\nFit and diagnosis together, by the clock on the wall, whatever else the machine had to do.\n\n| turns in a run | cases | median | nine of ten \
         below | longest | above 60 |\n|---|---|---|---|---|---|\n",
    );
    for periods in PERIODS {
        let here = records.iter().filter(|one| one.periods == periods && one.seconds > 0.0);
        let mut all: Vec<f64> = here.map(|one| one.seconds).collect();
        all.sort_by(f64::total_cmp);
        let at = |part: f64| all.get((part * all.len() as f64) as usize).copied();
        let text = |x: Option<f64>| x.map_or_else(|| "-".to_string(), |x| format!("{x:.1}"));
        let _ = writeln!(
            out,
            "| {periods} | {} | {} | {} | {} | {} |",
            all.len(),
            text(at(0.5)),
            text(at(0.9)),
            text(all.last().copied()),
            all.iter().filter(|x| **x > 60.0).count(),
        );
    }
}

fn labels(of: &[Member]) -> String {
    let all: Vec<&str> = of.iter().map(|one| one.label.as_str()).collect();
    if all.is_empty() { "(nothing)".to_string() } else { all.join(" and ") }
}

/// Every story with something in it that is not there.
fn wrong(out: &mut String, records: &[Record]) {
    out.push_str(
        "\n## Wrong stories\n\nEvery one. `--case` with the number runs it again.\n\n| case | hidden | in | strength | noise \
         | turns | known | seen | told |\n|---|---|---|---|---|---|---|---|---|\n",
    );
    let bar = |text: String| text.replace('|', "\\|").replace('\n', "; ");
    for one in records.iter().filter(|one| is_wrong(one)) {
        let noise = match one.noise > 0.0 {
            true => format!("{} %, {}", 100.0 * one.noise, one.colour),
            false => "0".to_string(),
        };
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} | {noise} | {} | {} | {} | {} |",
            one.number,
            bar(labels(&one.hidden)),
            one.base,
            if one.is(Kind::Nothing) { "-".to_string() } else { one.reach.0.to_string() },
            one.periods,
            one.known,
            one.seen,
            bar(labels(&one.story)),
        );
    }
}

/// Every effect that stood alone.
fn rows(out: &mut String, records: &[Record]) {
    out.push_str(
        "\n## Effect by effect\n\nSingle effects, and groups, where they are identifiable.\n\n| hidden | in | \
         right | or equal | of | instead |\n|---|---|---|---|---|---|\n",
    );
    let mut all: BTreeMap<(String, &str), Vec<&Record>> = BTreeMap::new();
    for one in records.iter().filter(|one| one.is(Kind::Single) || one.is(Kind::Group)) {
        if one.identifiable() {
            all.entry((labels(&one.hidden), &one.base)).or_default().push(one);
        }
    }
    for ((label, base), here) in all {
        let mut instead: BTreeMap<String, usize> = BTreeMap::new();
        for one in here.iter().filter(|one| !is_right(one)) {
            let what = match one.mark() {
                Mark::Equal | Mark::Wrong | Mark::Beside => labels(&one.story),
                mark => mark.text().to_string(),
            };
            *instead.entry(what).or_default() += 1;
        }
        let instead: Vec<String> = instead.iter().map(|(what, n)| format!("{what} {n}")).collect();
        let _ = writeln!(
            out,
            "| {label} | {base} | {} | {} | {} | {} |",
            here.iter().filter(|one| is_right(one)).count(),
            here.iter().filter(|one| is_good(one)).count(),
            here.len(),
            instead.join(", "),
        );
    }
}
