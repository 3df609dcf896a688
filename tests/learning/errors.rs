//! Columns that hold the standard errors of others: better values count more.

use std::fs;

use leverrier::{Options, Spec};

/// An oscillator with unit mass and stiffness, every value with an error of its own: every third is
/// fifty times as good as the others.
fn table(seed: u64, errors: impl Fn(usize) -> String) -> String {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    let mut generator = rand_pcg::Pcg64::seed_from_u64(seed);
    let mut text = String::from("t,x,x_err\n");
    for sample in 0..300 {
        let time = 0.1 * sample as f64;
        let draw: f64 = StandardNormal.sample(&mut generator);
        let value = time.cos() + error_of(sample) * draw;
        text += &format!("{time},{value},{}\n", errors(sample));
    }
    text
}

fn error_of(sample: usize) -> f64 {
    if sample.is_multiple_of(3) { 0.002 } else { 0.1 }
}

/// The stiffness with its error.
fn stiffness(text: &str, item: &str) -> Result<(f64, f64), leverrier::Error> {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("d.csv"), text).expect("written");
    let spec = format!(
        "coordinates x\nmomenta p\ntime t\ndata \"d.csv\" {{ time t  {item}  p not measured }}\n\
         T = p^2/2\nV = span{{ x^2 }}\n"
    );
    fs::write(folder.path().join("s.ham"), spec).expect("written");
    let spec = Spec::open(folder.path().join("s.ham"))?;
    let law = spec.fit_with(&spec.data()?, &Options::default())?;
    let term = &law.terms()[0];
    Ok((term.coefficient, term.standard_error))
}

#[test]
fn values_that_are_known_better_count_more() {
    let (mut with, mut without, mut pulls) = (0.0, 0.0, 0.0);
    for seed in 0..12 {
        let text = table(seed, |sample| error_of(sample).to_string());
        let (value, error) = stiffness(&text, "x = x error x_err").expect("a law");
        with += (value - 0.5).powi(2);
        pulls += ((value - 0.5) / error).powi(2);
        let (value, _) = stiffness(&text, "x = x").expect("a law");
        without += (value - 0.5).powi(2);
    }
    assert!(with < without / 100.0, "{with} {without}");
    // The mean of twelve squares that are each one by themselves.
    assert!((0.2..2.4).contains(&(pulls / 12.0)), "{pulls}");
}

#[test]
fn an_error_that_says_nothing_is_said_with_its_line() {
    let cases = [("0", "above zero"), ("-0.1", "above zero"), ("", "no standard error")];
    for (cell, sentence) in cases {
        let at = |sample| if sample == 7 { cell.to_string() } else { "0.1".to_string() };
        let error = stiffness(&table(1, at), "x = x error x_err").expect_err("an unsound error");
        let text = error.to_string();
        assert!(text.contains(sentence) && text.contains("line 9"), "{text}");
    }
    let text = table(1, |_| "0.1".to_string());
    let error = stiffness(&text, "x = x error y_err").expect_err("no such column").to_string();
    assert!(error.contains("the standard error of x") && error.contains("y_err"), "{error}");
}
