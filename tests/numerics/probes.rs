//! Probes: what a term that is not in the model would do to first order.

use leverrier::internals::dynamics::{Batch, Dynamics, Method, Scratch, advance};
use leverrier::internals::eval::Backend;
use leverrier::internals::expr::build;

/// Tangent columns of the terms, after a span of 1 from (0.9, 0.4).
fn columns(dynamics: &Dynamics, method: &str, steps: usize, theta: &[f64]) -> Vec<f64> {
    let mut batch = Batch::with_tangents(1, 1, dynamics.unknowns());
    batch.set(0, 0.3, &[0.9, 0.4]);
    let method = Method::by_name(method).unwrap();
    advance(dynamics, method, &mut batch, &[1.0], steps, theta, &mut Scratch::new());
    let width = batch.columns();
    (0..2).flat_map(|row| batch.tangent[row * width + 2..(row + 1) * width].to_vec()).collect()
}

#[test]
fn a_probe_does_what_the_term_would_do() {
    let spec = "coordinates q; momenta p\nT = p^2/2\nV = span{ cos(q) }\nH = span{ q^2*p^2 }\n\
                force q += span{ -p, -p*abs(p), cos(1.3*t), q }";
    let system = build("probes", spec).unwrap().system;
    let cosine = system.terms_where(|term| term.label == "cos(q)");
    let others = system.terms_where(|term| term.label != "cos(q)");
    let probing = Dynamics::with_probes(&system, &cosine, &others, Backend::Batched).unwrap();
    assert!(probing.separable());
    let everything = [cosine, others].concat();
    let whole = Dynamics::new(&system, &everything, Backend::Batched).unwrap();
    assert!(!whole.separable());
    let mut theta = vec![0.0; everything.len()];
    theta[0] = -1.0;
    let truth = columns(&whole, "gauss-legendre-6", 64, &theta);
    let coarse = columns(&probing, "leapfrog", 100, &theta);
    let fine = columns(&probing, "leapfrog", 200, &theta);
    for ((truth, coarse), fine) in truth.iter().zip(&coarse).zip(&fine) {
        assert!((truth - fine).abs() < 2e-5, "{truth} against {fine}");
        // Second order: half the step, a quarter of the error.
        assert!((truth - fine).abs() < 0.3 * (truth - coarse).abs() + 1e-9);
    }
}
