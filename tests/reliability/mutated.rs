//! Inputs made from other inputs at random: bytes and words changed, parts moved from one to the
//! next.

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;

use super::targets::{Target, WORDS};

/// The input of a number: a seed of the target with some changes. The same on every machine.
pub(crate) fn input(target: &Target, seeds: &[Vec<u8>], number: u64) -> Vec<u8> {
    let mut random = Pcg64::seed_from_u64(number ^ 0x5eed);
    if target.name == "run" {
        return super::choices::bytes(number, 400);
    }
    if target.name == "grammar" {
        return super::grammar::changed(seeds, &mut random);
    }
    let mut bytes = seeds.get(random.random_range(0..seeds.len())).cloned().unwrap_or_default();
    for _ in 0..random.random_range(1..6) {
        changed(&mut bytes, seeds, &mut random);
    }
    bytes
}

fn changed(bytes: &mut Vec<u8>, seeds: &[Vec<u8>], random: &mut Pcg64) {
    let at = random.random_range(0..bytes.len() + 1);
    let end = (at + random.random_range(0..40)).min(bytes.len());
    match random.random_range(0..8) {
        0 if at < bytes.len() => bytes[at] = random.random_range(0..=255),
        1 if at < bytes.len() => bytes[at] ^= 1 << random.random_range(0..8),
        2 => drop(bytes.drain(at..end)),
        3 => {
            let part: Vec<u8> = bytes[at..end].to_vec();
            let times = random.random_range(1..20);
            bytes.splice(at..at, part.repeat(times));
        }
        4 | 5 => {
            let word = WORDS[random.random_range(0..WORDS.len())];
            bytes.splice(at..at, word.bytes());
        }
        6 => {
            let other = &seeds[random.random_range(0..seeds.len())];
            let from = random.random_range(0..other.len() + 1);
            let to = (from + random.random_range(0..200)).min(other.len());
            bytes.splice(at..end, other[from..to].iter().copied());
        }
        // A number of eight bytes, or of four, that is as large as can be.
        _ if bytes.len() >= 8 => {
            let at = at.min(bytes.len() - 8);
            let size = random.random_range(1..9);
            bytes[at..at + size].fill(0xff);
        }
        _ => bytes.push(random.random_range(0..=255)),
    }
}
