//! What the lines above a table say of how often its rows were taken.

/// What a sampling rate is called, and what the time between samples is.
const WORDS: &[(&str, Told)] = &[
    ("sampling rate", Told::Rate),
    ("sampling frequency", Told::Rate),
    ("sample rate", Told::Rate),
    ("samplerate", Told::Rate),
    ("samples per second", Told::Rate),
    ("frame rate", Told::Rate),
    ("framerate", Told::Rate),
    ("abtastrate", Told::Rate),
    ("abtastfrequenz", Told::Rate),
    ("messrate", Told::Rate),
    ("fréquence d'échantillonnage", Told::Rate),
    ("frecuencia de muestreo", Told::Rate),
    ("fps", Told::Rate),
    ("fs", Told::Rate),
    ("sampling interval", Told::Interval),
    ("sample interval", Told::Interval),
    ("sampling period", Told::Interval),
    ("sample period", Told::Interval),
    ("time step", Told::Interval),
    ("timestep", Told::Interval),
    ("abtastintervall", Told::Interval),
    ("abtastzeit", Told::Interval),
    ("période d'échantillonnage", Told::Interval),
    ("delta_t", Told::Interval),
    ("dt", Told::Interval),
];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Told {
    Rate,
    Interval,
}

/// Units behind a number, and how many seconds or hertz they are.
const UNITS: &[(&str, Told, f64)] = &[
    ("hz", Told::Rate, 1.0),
    ("khz", Told::Rate, 1e3),
    ("mhz", Told::Rate, 1e6),
    ("fps", Told::Rate, 1.0),
    ("s", Told::Interval, 1.0),
    ("sec", Told::Interval, 1.0),
    ("ms", Told::Interval, 1e-3),
    ("us", Told::Interval, 1e-6),
    ("µs", Told::Interval, 1e-6),
    ("μs", Told::Interval, 1e-6),
    ("ns", Told::Interval, 1e-9),
];

/// Seconds from one sample to the next, as a line says it: `Sampling rate: 10 Hz`.
pub(super) fn seconds_between(line: &str) -> Option<f64> {
    let line = line.to_lowercase().replace('_', " ");
    WORDS.iter().find_map(|(word, told)| {
        let word = word.replace('_', " ");
        let (before, rest) = line.split_once(&word)?;
        let is_whole = !before.ends_with(char::is_alphanumeric)
            && !rest.starts_with(|c: char| c.is_alphabetic());
        if !is_whole {
            return None;
        }
        let part = |c: char| !(c.is_alphanumeric() || matches!(c, '.' | '+' | '-'));
        let mut number = None;
        let mut unit = None;
        for piece in decimal_points(rest).split(part).filter(|piece| !piece.is_empty()) {
            let digits = piece.trim_end_matches(char::is_alphabetic);
            number = number.or_else(|| piece.parse().or_else(|_| digits.parse::<f64>()).ok());
            let behind = piece.get(digits.len()..).unwrap_or_default();
            unit = unit.or_else(|| UNITS.iter().find(|row| row.0 == behind));
        }
        let (told, scale) = unit.map_or((*told, 1.0), |row| (row.1, row.2));
        let value = number? * scale;
        let seconds = if told == Told::Rate { 1.0 / value } else { value };
        (seconds.is_finite() && seconds > 0.0).then_some(seconds)
    })
}

/// A text with a point for each comma between two digits; any other comma separates.
fn decimal_points(text: &str) -> String {
    let characters: Vec<char> = text.chars().collect();
    let digit =
        |at: Option<usize>| at.and_then(|at| characters.get(at)).is_some_and(char::is_ascii_digit);
    let of = |(at, &c): (usize, &char)| match c {
        ',' if digit(at.checked_sub(1)) && digit(Some(at + 1)) => '.',
        ',' => ' ',
        c => c,
    };
    characters.iter().enumerate().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::seconds_between;

    #[test]
    fn rates_and_intervals_are_understood() {
        for (line, expected) in [
            ("Sampling rate: 10 Hz", Some(0.1)),
            ("# fs = 2 kHz", Some(0.0005)),
            ("Sample interval (ms);20", Some(0.02)),
            ("Abtastrate\t50,0 Hz", Some(0.02)),
            ("dt=0.25", Some(0.25)),
            ("SampleRate [Hz],100", Some(0.01)),
            ("Sample rate,100,Hz", Some(0.01)),
            ("delta_t: 5e-3 s", Some(0.005)),
            ("video at 25 fps", None),
            ("width 3", None),
            ("Sampling rate: 0 Hz", None),
            ("offset 1", None),
        ] {
            let found = seconds_between(line);
            let same = match (found, expected) {
                (Some(found), Some(expected)) => (found - expected).abs() < 1e-12,
                (found, expected) => found == expected,
            };
            assert!(same, "{line}: {found:?}");
        }
    }
}
