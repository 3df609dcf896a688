//! Orbits of a body that nobody sees, by what its pull does to those that are seen.
//!
//! Circles about the common centre come first, in the plane in which all turns, near and far; the
//! best of them are starts of orbits that are free, which move by the pull of all that is known
//! (Gauss-Newton, with damping after Levenberg and Marquardt). The mass is linear in either.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::response::Stretch;

type Place = [f64; 3];

/// The motion of bodies that are known, by the model that stands.
pub(super) struct Path {
    pub(super) times: Vec<f64>,
    /// `[node][body]`
    pub(super) places: Vec<Vec<Place>>,
    /// `[node][body]`
    pub(super) velocities: Vec<Vec<Place>>,
    pub(super) masses: Vec<f64>,
    pub(super) gravity: f64,
    /// Number of coordinates of a body.
    pub(super) axes: usize,
}

/// What the model leaves of the measurements, and what a pull could do to it.
pub(super) struct Left<'a> {
    pub(super) path: &'a Path,
    pub(super) stretches: &'a [Stretch],
    /// For each stretch, in units of the noise.
    pub(super) residuals: &'a [DVector<f64>],
}

/// An orbit, by the place and the velocity at the first node of the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Orbit {
    pub(super) place: Place,
    /// The same from the common centre of what is known.
    pub(super) from_centre: Place,
    pub(super) velocity: Place,
    pub(super) mass: f64,
    /// Squares, in units of the noise, that the body takes from what the model leaves.
    pub(super) gain: f64,
}

/// The orbits that are tried first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Circles {
    /// The smallest radius, in distances of the nearest known body,
    pub(super) nearest: f64,
    /// and the largest, in those of the farthest.
    pub(super) farthest: f64,
    /// Neighbouring radii differ by this part at most,
    pub(super) part: f64,
    /// and get out of step by this angle over the path at most.
    pub(super) out_of_step: f64,
    /// Places on a circle.
    pub(super) phases: usize,
    /// Turns are followed by so many nodes, at least.
    pub(super) nodes: f64,
}

impl Orbit {
    /// Whether it begins farther from another than by a part of its distance from the common
    /// centre, or moves another way.
    pub(super) fn is_apart(&self, other: &Orbit, part: f64) -> bool {
        let far = norm(minus(self.from_centre, other.from_centre)) > part * norm(self.from_centre);
        let faster = norm(minus(self.velocity, other.velocity)) > norm(self.velocity);
        far || faster
    }
}

impl Path {
    fn centre(&self, node: usize, of: &[Vec<Place>]) -> Place {
        let total: f64 = self.masses.iter().sum();
        let bodies = of[node].iter().zip(&self.masses);
        let sum = bodies
            .fold([0.0; 3], |sum, (place, mass)| std::array::from_fn(|a| sum[a] + mass * place[a]));
        sum.map(|x| x / total)
    }

    /// Two axes of the plane in which all turns, and the nearest and the farthest distance from the
    /// common centre.
    fn frame(&self) -> Option<([Place; 2], f64, f64)> {
        let mut turning = [0.0; 3];
        let bodies = self.masses.len();
        let mut sizes = vec![(0.0, 0.0); bodies];
        for node in 0..self.times.len() {
            let centre = self.centre(node, &self.places);
            let drift = self.centre(node, &self.velocities);
            for (body, size) in sizes.iter_mut().enumerate() {
                let place = minus(self.places[node][body], centre);
                let velocity = minus(self.velocities[node][body], drift);
                let turn = cross(place, velocity);
                turning = std::array::from_fn(|a| turning[a] + self.masses[body] * turn[a]);
                size.0 += norm(place);
                size.1 += 1.0;
            }
        }
        let normal = unit(turning)?;
        let other = if normal[0].abs() < 0.9 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
        let across = unit(cross(normal, other))?;
        let sizes: Vec<f64> = sizes.iter().map(|(sum, count)| sum / count).collect();
        let far = sizes.iter().copied().fold(0.0, f64::max);
        // The heaviest is near the centre: it bounds no orbit from within.
        let near = sizes.iter().copied().filter(|size| *size > 0.02 * far);
        let near = near.fold(f64::INFINITY, f64::min);
        Some(([across, cross(normal, across)], near, far))
    }

    /// Circles about the common centre, in both directions: place and velocity at the first node.
    fn circles(&self, circles: &Circles) -> Vec<(f64, f64, [Place; 2])> {
        let Some((axes, near, far)) = self.frame() else { return Vec::new() };
        let pull = self.gravity * self.masses.iter().sum::<f64>();
        let span = self.times[self.times.len() - 1] - self.times[0];
        let step = span / (self.times.len() - 1) as f64;
        let mut radius = circles.nearest * near;
        let shortest = circles.nodes * step / std::f64::consts::TAU;
        radius = radius.max((pull * shortest * shortest).cbrt());
        let mut out = Vec::new();
        while radius < circles.farthest * far {
            let rate = (pull / radius.powi(3)).sqrt();
            for k in 0..circles.phases {
                let phase = std::f64::consts::TAU * k as f64 / circles.phases as f64;
                out.push((radius, phase, axes));
                out.push((radius, phase, [axes[0], axes[1].map(|x| -x)]));
            }
            // d(rate)/d(radius) = -3/2 rate/radius.
            let apart = circles.out_of_step / (1.5 * rate * span);
            radius *= 1.0 + apart.min(circles.part);
        }
        out
    }

    /// Places on a circle at all nodes.
    fn along_circle(&self, (radius, phase, axes): &(f64, f64, [Place; 2])) -> Vec<(Place, Place)> {
        let pull = self.gravity * self.masses.iter().sum::<f64>();
        let rate = (pull / radius.powi(3)).sqrt();
        let at = |node: usize| {
            let (sine, cosine) = (phase + rate * (self.times[node] - self.times[0])).sin_cos();
            let (centre, drift) =
                (self.centre(node, &self.places), self.centre(node, &self.velocities));
            let on = |c: f64, s: f64| -> Place {
                std::array::from_fn(|a| radius * (c * axes[0][a] + s * axes[1][a]))
            };
            let (place, velocity) = (on(cosine, sine), on(-sine * rate, cosine * rate));
            (
                std::array::from_fn(|a| centre[a] + place[a]),
                std::array::from_fn(|a| drift[a] + velocity[a]),
            )
        };
        (0..self.times.len()).map(at).collect()
    }

    fn pull(&self, at: &Place, bodies: &[Place]) -> Place {
        let mut sum = [0.0; 3];
        for (body, mass) in bodies.iter().zip(&self.masses) {
            let apart = minus(*body, *at);
            let size = self.gravity * mass / norm(apart).powi(3);
            for a in 0..3 {
                sum[a] += size * apart[a];
            }
        }
        sum
    }

    /// Places of a free orbit at all nodes, by the classical method of Runge and Kutta.
    fn along_orbit(&self, place: &Place, velocity: &Place) -> Vec<Place> {
        let (mut x, mut v) = (*place, *velocity);
        let mut out = Vec::with_capacity(self.times.len());
        let plus =
            |x: &Place, h: f64, v: &Place| -> Place { std::array::from_fn(|a| x[a] + h * v[a]) };
        out.push(x);
        for node in 0..self.times.len() - 1 {
            let h = self.times[node + 1] - self.times[node];
            let (start, end) = (&self.places[node], &self.places[node + 1]);
            let between = |body: usize| -> Place {
                let slopes = (&self.velocities[node][body], &self.velocities[node + 1][body]);
                std::array::from_fn(|a| {
                    0.5 * (start[body][a] + end[body][a]) + 0.125 * h * (slopes.0[a] - slopes.1[a])
                })
            };
            let middle: Vec<Place> = (0..start.len()).map(between).collect();
            let a1 = self.pull(&x, start);
            let (x2, v2) = (plus(&x, 0.5 * h, &v), plus(&v, 0.5 * h, &a1));
            let a2 = self.pull(&x2, &middle);
            let (x3, v3) = (plus(&x, 0.5 * h, &v2), plus(&v, 0.5 * h, &a2));
            let a3 = self.pull(&x3, &middle);
            let (x4, v4) = (plus(&x, h, &v3), plus(&v, h, &a3));
            let a4 = self.pull(&x4, end);
            x = std::array::from_fn(|a| x[a] + h / 6.0 * (v[a] + 2.0 * (v2[a] + v3[a]) + v4[a]));
            v = std::array::from_fn(|a| v[a] + h / 6.0 * (a1[a] + 2.0 * (a2[a] + a3[a]) + a4[a]));
            out.push(x);
        }
        out
    }
}

impl Left<'_> {
    /// What a body of mass one at these places does to what was measured.
    fn response(&self, places: &[Place]) -> DVector<f64> {
        self.response_but(places, None)
    }

    /// The same where it does nothing to one of the known bodies, which it is itself.
    fn response_but(&self, places: &[Place], itself: Option<usize>) -> DVector<f64> {
        let path = self.path;
        let mut all = Vec::new();
        for stretch in self.stretches {
            let mut forces = Vec::with_capacity(stretch.nodes() * path.masses.len() * path.axes);
            let nodes = places.iter().zip(&path.places).skip(stretch.first).take(stretch.nodes());
            for (place, bodies) in nodes {
                for (at, (body, mass)) in bodies.iter().zip(&path.masses).enumerate() {
                    let apart = minus(*place, *body);
                    let size = match itself {
                        Some(other) if other == at => 0.0,
                        _ => path.gravity * mass / norm(apart).powi(3),
                    };
                    forces.extend(apart.iter().take(path.axes).map(|x| size * x));
                }
            }
            all.extend_from_slice(stretch.response(&forces).as_slice());
        }
        DVector::from_vec(all)
    }

    /// What is left, stretch after stretch.
    pub(super) fn target(&self) -> DVector<f64> {
        let all: Vec<f64> = self.residuals.iter().flat_map(|r| r.iter().copied()).collect();
        DVector::from_vec(all)
    }

    /// All circles that a mass above zero fits to, the best first.
    pub(super) fn circles(&self, circles: &Circles) -> Vec<Orbit> {
        let target = self.target();
        let tried = |circle: &(f64, f64, [Place; 2])| {
            let along = self.path.along_circle(circle);
            let places: Vec<Place> = along.iter().map(|(place, _)| *place).collect();
            let (mass, gain) = fitted(&target, &self.response(&places))?;
            let (place, velocity) = along[0];
            let from_centre = minus(place, self.path.centre(0, &self.path.places));
            Some(Orbit { place, from_centre, velocity, mass, gain })
        };
        let all = self.path.circles(circles);
        let mut found: Vec<Orbit> = all.par_iter().filter_map(tried).collect();
        found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        found
    }

    /// What a change of the mass of one known body takes off, at most.
    pub(super) fn by_a_mass(&self) -> f64 {
        let target = self.target();
        let of = |body: usize| {
            let places = self.path.places.iter().map(|bodies| bodies[body]);
            let column = self.response_but(&places.collect::<Vec<Place>>(), Some(body));
            let square = column.norm_squared();
            if square > 0.0 { target.dot(&column).powi(2) / square } else { 0.0 }
        };
        (0..self.path.masses.len()).map(of).fold(0.0, f64::max)
    }

    /// What is left beside a body on a free orbit.
    pub(super) fn beside(&self, orbit: &Orbit) -> DVector<f64> {
        let places = self.path.along_orbit(&orbit.place, &orbit.velocity);
        self.target() - self.response(&places) * orbit.mass
    }

    /// The orbit near another that takes most, by so many steps at most.
    pub(super) fn refined(&self, start: &Orbit, steps: usize) -> Orbit {
        let target = self.target();
        let centre = self.path.centre(0, &self.path.places);
        let drift = self.path.centre(0, &self.path.velocities);
        let sizes = (norm(minus(start.place, centre)), norm(minus(start.velocity, drift)));
        let at = |z: &[f64; 6]| -> (Place, Place) {
            (
                std::array::from_fn(|a| start.place[a] + sizes.0 * z[a]),
                std::array::from_fn(|a| start.velocity[a] + sizes.1 * z[3 + a]),
            )
        };
        let response = |z: &[f64; 6]| {
            let (place, velocity) = at(z);
            self.response(&self.path.along_orbit(&place, &velocity))
        };
        let mut z = [0.0; 6];
        let mut column = response(&z);
        let Some(mut best) = fitted(&target, &column) else { return *start };
        // Levenberg's damping, as a part of the squares of each column.
        let mut damping = 1e-2;
        let axes = self.path.axes;
        let free: Vec<usize> = (0..6).filter(|k| k % 3 < axes).collect();
        for _ in 0..steps {
            let left = &target - &column * best.0;
            let slopes: Vec<DVector<f64>> = free
                .iter()
                .map(|&k| {
                    let mut there = z;
                    there[k] += STEP;
                    (response(&there) - &column) * (best.0 / STEP)
                })
                .collect();
            let mut jacobian = DMatrix::zeros(target.len(), free.len() + 1);
            for (k, slope) in slopes.iter().enumerate() {
                jacobian.set_column(k, slope);
            }
            jacobian.set_column(free.len(), &(&column * best.0));
            let normal = jacobian.tr_mul(&jacobian);
            let gradient = jacobian.tr_mul(&left);
            let mut improved = false;
            for _ in 0..6 {
                let mut damped = normal.clone();
                for k in 0..damped.nrows() {
                    damped[(k, k)] *= 1.0 + damping;
                }
                let Some(solved) = damped.cholesky() else {
                    damping *= 10.0;
                    continue;
                };
                let move_by = solved.solve(&gradient);
                let mut there = z;
                for (k, &place) in free.iter().enumerate() {
                    there[place] += move_by[k].clamp(-FARTHEST_STEP, FARTHEST_STEP);
                }
                let next = response(&there);
                match fitted(&target, &next) {
                    Some(found) if found.1 > best.1 => {
                        improved = found.1 > best.1 * (1.0 + 1e-6);
                        (z, column, best) = (there, next, found);
                        damping = (0.2 * damping).max(1e-9);
                        break;
                    }
                    _ => damping *= 5.0,
                }
            }
            if !improved {
                break;
            }
        }
        let (place, velocity) = at(&z);
        Orbit { place, from_centre: minus(place, centre), velocity, mass: best.0, gain: best.1 }
    }
}

/// Step of the differences that slopes are taken by, and the longest of the search, in parts of the
/// distance and of the velocity.
const STEP: f64 = 1e-4;
const FARTHEST_STEP: f64 = 0.3;

/// The mass that makes most of a response, and what it takes off; `None` where it is not above
/// zero.
fn fitted(target: &DVector<f64>, column: &DVector<f64>) -> Option<(f64, f64)> {
    let (product, square) = (target.dot(column), column.norm_squared());
    let mass = product / square;
    (mass > 0.0 && mass.is_finite()).then_some((mass, product * mass))
}

fn minus(a: Place, b: Place) -> Place {
    std::array::from_fn(|k| a[k] - b[k])
}

fn cross(a: Place, b: Place) -> Place {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn norm(a: Place) -> f64 {
    a.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn unit(a: Place) -> Option<Place> {
    let size = norm(a);
    (size > 0.0 && size.is_finite()).then(|| a.map(|x| x / size))
}
