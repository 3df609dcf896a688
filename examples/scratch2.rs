use leverrier::data::*;
use leverrier::expr::*;
use leverrier::fit::{Silent, Options, fit};
use std::path::Path;
fn main() {
    let table = read(Path::new("/work/shared/data/real_pendulum.csv")).unwrap();
    let mapping = Mapping { time: Some(ColumnMap::plain("t")), run: Some("trial".into()), observables: vec![ObservableMap::plain("theta"), ObservableMap::plain("omega")] };
    let (data, report) = dataset(&table, &mapping).unwrap();
    println!("{}", report.to_text());
    let mut g = Graph::new();
    let q = g.symbol(Symbol::Coordinate(0)); let p = g.symbol(Symbol::Momentum(0));
    let kin = { let s = g.power(p, 2.0); g.scale(0.5, s) };
    let cos = g.apply(Function::by_name("cos").unwrap(), q);
    let mut exprs = vec![("cos", Place::Potential, cos)];
    if std::env::args().count() > 1 {
        let sin2 = { let d = g.scale(2.0, q); g.apply(Function::by_name("sin").unwrap(), d) };
        exprs.push(("sin2", Place::Potential, sin2));
        exprs.push(("q", Place::Potential, q));
        let q2 = g.power(q, 2.0); exprs.push(("q2", Place::Potential, q2));
        exprs.push(("drag", Place::Force(0), p));
    }
    let terms = exprs.into_iter().map(|(l, place, expr)| Term { place, expr, label: l.into(), name: None, bounds: Bounds::FREE, unit: None, unit_text: None }).collect();
    let zero = g.number(0.0);
    let v = |s: &str| Variable { name: s.into(), unit: None, unit_text: None };
    let system = System { name: "t".into(), graph: g, coordinates: vec![v("theta")], momenta: vec![v("omega")], observed: Observed::Momenta, velocities: vec![], time: v("t"), parameters: vec![], kinetic: kin, potential: zero, hamiltonian: zero, forces: vec![zero], terms };
    for window in [Some(2), Some(4), Some(8), Some(12), Some(16), Some(32), None] {
    let options = Options { window, ..Default::default() };
    let m = fit(&system, &data, &options, &Silent).unwrap();
    println!("{window:?} {} {:?} noise {:?} err {}", m.evidence.window, m.terms.iter().map(|t| (t.term.clone(), t.coefficient, t.standard_error)).collect::<Vec<_>>(), m.noise.iter().map(|n| n.standard_deviation).collect::<Vec<_>>(), m.evidence.error);
    }
}
