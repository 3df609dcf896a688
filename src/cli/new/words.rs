//! What headers say: a name, a unit, a run or a body, in the words of several languages.

use crate::data::{Column, is_time_unit, known_unit};
use crate::expr::Unit;

/// A column as its header is understood.
#[derive(Debug, Clone)]
pub(super) struct Named<'a> {
    pub column: &'a Column,
    /// The name without unit, run and body.
    pub name: String,
    /// The name in small letters, in the words of the tables here.
    pub key: String,
    /// The symbol behind a word: `v` of `Geschwindigkeit v`.
    alias: Option<String>,
    /// The unit in the words of the mini-language, where it knows it.
    pub unit: Option<String>,
    /// The run or body that the header names beside.
    pub group: String,
}

/// Words for times (in lower case) that need no unit to be told.
const TIMES: &[&str] = &[
    "t",
    "time",
    "timestamp",
    "datetime",
    "zeit",
    "uhrzeit",
    "zeitstempel",
    "temps",
    "tiempo",
    "tempo",
    "tijd",
    "elapsed",
    "seconds",
    "sekunden",
    "secondes",
    "segundos",
    "heure",
    "hora",
    "clock",
    "millis",
    "time_s",
    "x_value",
    "xvalue",
];

/// Words for times that may be other things: a date, an axis.
const PERHAPS_TIMES: &[&str] =
    &["date", "datum", "fecha", "x-axis", "x_axis", "xaxis", "s", "sec", "ms", "moment"];

/// Words for counts of pictures or samples.
const COUNTS: &[&str] = &[
    "frame",
    "frames",
    "framenumber",
    "frame_number",
    "bild",
    "image",
    "imagen",
    "step",
    "schritt",
    "pas",
    "paso",
    "sample",
    "samples",
    "sampleindex",
    "index",
    "idx",
    "nr",
    "no",
    "number",
    "n",
    "i",
    "#",
    "point",
    "punkt",
    "row",
    "zeile",
    "count",
    "record",
    "scan",
    "messung",
    "mesure",
    "id",
];

/// Words for quantities, and what they are called here.
const QUANTITIES: &[(&str, &str)] = &[
    ("winkel", "angle"),
    ("angulo", "angle"),
    ("ángulo", "angle"),
    ("auslenkwinkel", "angle"),
    ("drehwinkel", "angle"),
    ("rotation", "angle"),
    ("angular_position", "angle"),
    ("angular_displacement", "angle"),
    ("winkelposition", "angle"),
    ("position_angulaire", "angle"),
    ("posición_angular", "angle"),
    ("ang_vel", "angular_velocity"),
    ("angvel", "angular_velocity"),
    ("θ", "theta"),
    ("ϑ", "theta"),
    ("φ", "phi"),
    ("ϕ", "phi"),
    ("α", "alpha"),
    ("ψ", "psi"),
    ("ω", "omega"),
    ("τ", "tau"),
    ("winkelgeschwindigkeit", "angular_velocity"),
    ("drehrate", "angular_velocity"),
    ("vitesse_angulaire", "angular_velocity"),
    ("velocidad_angular", "angular_velocity"),
    ("angular_speed", "angular_velocity"),
    ("angular_rate", "angular_velocity"),
    ("weg", "position"),
    ("ort", "position"),
    ("lage", "position"),
    ("strecke", "position"),
    ("posición", "position"),
    ("posicion", "position"),
    ("posizione", "position"),
    ("distance", "position"),
    ("distanz", "position"),
    ("abstand", "position"),
    ("distancia", "position"),
    ("location", "position"),
    ("auslenkung", "displacement"),
    ("verschiebung", "displacement"),
    ("élongation", "displacement"),
    ("elongation", "displacement"),
    ("déplacement", "displacement"),
    ("deplacement", "displacement"),
    ("desplazamiento", "displacement"),
    ("elongación", "displacement"),
    ("amplitude", "displacement"),
    ("höhe", "height"),
    ("hoehe", "height"),
    ("hauteur", "height"),
    ("altura", "height"),
    ("altitude", "height"),
    ("geschwindigkeit", "velocity"),
    ("vitesse", "velocity"),
    ("velocidad", "velocity"),
    ("velocità", "velocity"),
    ("speed", "velocity"),
    ("impuls", "momentum"),
    ("kraft", "force"),
    ("fuerza", "force"),
    ("forza", "force"),
    ("drehmoment", "torque"),
    ("couple", "torque"),
    ("spannung", "voltage"),
    ("tension", "voltage"),
    ("tensión", "voltage"),
    ("voltaje", "voltage"),
    ("strom", "current"),
    ("courant", "current"),
    ("corriente", "current"),
];

/// Names of columns that drive a motion rather than follow it.
const DRIVING: &[&str] = &[
    "u", "f", "force", "torque", "tau", "voltage", "current", "input", "command", "drive",
    "control", "motor", "pwm", "actuator", "setpoint",
];

/// Words for the errors of a measurement.
const ERRORS: &[&str] = &[
    "err",
    "error",
    "errors",
    "sigma",
    "std",
    "stdev",
    "stddev",
    "sd",
    "unc",
    "uncertainty",
    "fehler",
    "unsicherheit",
    "erreur",
    "incertitude",
    "incertidumbre",
    "standardabweichung",
    "delta",
    "σ",
    "δ",
    "stderr",
    "sem",
];

/// How surely a name is one of a time: 0 is not at all.
pub(super) fn likeness_to_time(named: &Named) -> u32 {
    let words = words(&named.name);
    let first = words.first().map_or("", String::as_str);
    // `T` is a temperature or a torque.
    let whole = if named.name.trim() == "T" { "" } else { named.key.as_str() };
    let says =
        |names: &[&str]| names.contains(&whole) || (first.len() > 1 && names.contains(&first));
    let unit = named.unit.as_deref();
    let measures = unit.is_some_and(is_time_unit);
    // A time has no other unit.
    if unit.is_some_and(|unit| unit != "1" && !is_time_unit(unit)) {
        return 0;
    }
    let time = words.iter().any(|word| TIMES.contains(&word.as_str()) && word.len() > 1);
    match () {
        () if says(TIMES) && measures => 9,
        () if says(TIMES) => 8,
        () if time && measures => 7,
        () if time => 6,
        () if says(PERHAPS_TIMES) && measures => 5,
        () if says(PERHAPS_TIMES) => 4,
        // A period or a delay has such a unit, too.
        () if measures => 3,
        () if is_count(named) => 2,
        () => 0,
    }
}

/// Whether a column counts pictures or samples.
pub(super) fn is_count(named: &Named) -> bool {
    let words = words(&named.name);
    let first = words.first().map_or("", String::as_str);
    COUNTS.contains(&named.key.as_str())
        || (COUNTS.contains(&first) && words.len() < 3 && named.unit.is_none())
        || named.name.trim() == "#"
}

/// Whether a column drives the motion, by its name, or by its unit.
pub(super) fn drives(named: &Named) -> Option<ByWhat> {
    let stem = super::parted(&named.key).0;
    if DRIVING.contains(&stem.as_str()) {
        return Some(ByWhat::Name);
    }
    let words = words(&named.name);
    let said = |word: &String| word.len() > 1 && DRIVING.contains(&quantity(word).as_str());
    if words.iter().any(said) {
        return Some(ByWhat::Name);
    }
    let of_force = |unit: &str| {
        let is = |like: &str| {
            let (unit, like) = (Unit::parse(unit), Unit::parse(like));
            unit.is_ok_and(|unit| like.is_ok_and(|like| unit.same_kind(like)))
        };
        ["N", "N*m", "V", "A"].into_iter().any(is)
    };
    named.unit.as_deref().is_some_and(of_force).then_some(ByWhat::Unit)
}

/// What tells that a column drives the motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ByWhat {
    Name,
    Unit,
}

/// The name of what a column holds the errors of, empty where it does not say; none where it
/// holds none.
pub(super) fn error_of(named: &Named) -> Option<String> {
    let lower = named.name.trim().to_lowercase();
    let written = ["±", "+/-", "+-"].into_iter().find(|mark| lower.contains(mark));
    if let Some(mark) = written {
        // `x ± 0.1` tells the errors of x.
        let behind = lower.split_once(mark).map_or("", |(_, behind)| behind).trim();
        if behind.starts_with(|c: char| c.is_ascii_digit()) {
            return None;
        }
        return Some(lower.replace(mark, "").trim().to_string());
    }
    for mark in ['σ', 'δ', 'Δ'] {
        if let Some(rest) = lower.strip_prefix(mark) {
            return Some(rest.trim_matches(['_', ' ', '(', ')']).to_string());
        }
    }
    let words = words(&lower);
    let says = |word: &String| ERRORS.contains(&word.as_str());
    if !words.iter().any(says) {
        return None;
    }
    let small = ["of", "in", "von", "de", "du", "la", "der", "des", "dev", "abs", "rel"];
    let rest: Vec<&str> = words
        .iter()
        .filter(|w| !says(w) && !small.contains(&w.as_str()))
        .map(String::as_str)
        .collect();
    Some(rest.join("_"))
}

/// The words of a name, in small letters.
pub(super) fn words(name: &str) -> Vec<String> {
    let lower = name.to_lowercase();
    let words = lower.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    words.map(str::to_string).collect()
}

/// A word as it is called here.
fn quantity(word: &str) -> String {
    let row = QUANTITIES.iter().find(|(name, _)| *name == word);
    row.map_or_else(|| word.to_string(), |(_, here)| (*here).to_string())
}

/// Words before a colon, or behind a name, that tell runs apart.
const RUNS: &[&str] = &[
    "run",
    "latest",
    "set",
    "trial",
    "versuch",
    "messreihe",
    "messung",
    "série",
    "serie",
    "lauf",
    "durchgang",
    "essai",
    "ensayo",
    "dataset",
];

/// Whether a group of columns is a run rather than a body.
pub(super) fn is_run(group: &str) -> bool {
    words(group).iter().any(|word| RUNS.contains(&word.as_str()))
}

impl<'a> Named<'a> {
    /// Reads a header.
    pub(super) fn new(column: &'a Column) -> Named<'a> {
        let mut name = column.name.trim().trim_matches(['"', '\'', '$']).to_string();
        let known = |unit: &str| known_unit(unit).filter(|unit| Unit::parse(unit).is_ok());
        let mut unit = column.unit.as_deref().and_then(known);
        // What follows a name: a colon, the error of all readings, the channel of an instrument.
        if let Some((before, behind)) = name.split_once('±')
            && behind.trim().starts_with(|c: char| c.is_ascii_digit())
        {
            name = before.trim().to_string();
        }
        name = name.trim_end_matches([':', ' ']).to_string();
        let mut group = String::new();
        // A body or a run before a colon, or a run behind the name.
        let split =
            name.rsplit_once(':').map(|(a, b)| (a.trim().to_string(), b.trim().to_string()));
        if let Some((before, rest)) = split.filter(|(a, b)| !a.is_empty() && !b.is_empty()) {
            (group, name) = (before, rest);
        }
        if let Some((before, behind)) = name.split_once(',')
            && unit.is_some()
            && group.is_empty()
            && !before.trim().is_empty()
        {
            let (before, behind) = (before.trim().to_string(), behind.trim().to_string());
            (name, group) = (before, behind);
        }
        let lower = name.to_lowercase();
        let run = RUNS.iter().find_map(|run| lower.rfind(&format!(" {run} ")));
        let run = run.or_else(|| lower.rfind(" run#")).or_else(|| lower.rfind(" (run"));
        if let Some(at) = run.filter(|at| *at > 0 && name.is_char_boundary(*at)) {
            group = name.split_off(at).trim().trim_matches(['(', ')']).to_string();
        }
        // `marker 1 X`: an axis of a body.
        let axis = name.rsplit_once([' ', '_']).map(|(a, b)| (a.to_string(), b.to_string()));
        if let Some((body, axis)) = axis
            && matches!(axis.as_str(), "X" | "Y" | "Z" | "x" | "y" | "z")
            && group.is_empty()
            && is_body(&body)
        {
            (group, name) = (body, axis);
        }
        if unit.is_none() && column.unit.is_none() {
            let (rest, found) = unit_in(&name);
            (name, unit) = (rest, found.as_deref().and_then(known));
        } else if let Some(inside) = column.unit.as_deref().filter(|_| unit.is_none()) {
            // `angle (theta)`: a bracket with a name in it is part of the name.
            let plain = inside.chars().all(|c| c.is_alphanumeric() || c == '_');
            if plain && inside.len() > 2 && name.is_empty() {
                name = inside.to_string();
            }
        }
        let key = key_of(&name);
        let alias = symbol(&name).map(str::to_lowercase);
        let name = symbol(&name).map_or_else(|| name.clone(), str::to_string);
        Named { column, name, key, alias, unit, group }
    }

    /// The stems and indices by which its partner is looked for.
    pub(super) fn parts(&self) -> Vec<(String, String)> {
        let alias = self.alias.as_deref().map(super::parted);
        let alias = alias.map(|(stem, index)| (quantity(&stem), format!("{index}@{}", self.group)));
        [Some(self.parted()), alias].into_iter().flatten().collect()
    }

    /// Whether a word means this column: its name, its symbol or what either is called here.
    pub(super) fn is_called(&self, word: &str) -> bool {
        let alias = self.alias.as_deref();
        let here = quantity(word);
        [Some(self.key.as_str()), alias].into_iter().flatten().any(|own| own == word || own == here)
            || self.name.to_lowercase() == word
    }

    /// The name by which its partner is looked for, with the body that it belongs to.
    pub(super) fn whole(&self) -> String {
        format!("{}@{}", self.key, self.group)
    }

    /// The same as a stem and an index.
    pub(super) fn parted(&self) -> (String, String) {
        // `position_x` is one of several, as `position 1` is.
        let axis = self
            .key
            .rsplit_once('_')
            .filter(|(stem, axis)| matches!(*axis, "x" | "y" | "z") && stem.chars().count() > 1);
        let (stem, index) = match axis {
            Some((stem, axis)) => (stem.to_string(), axis.to_string()),
            None => super::parted(&self.key),
        };
        (quantity(&stem), format!("{index}@{}", self.group))
    }
}

/// The symbol that stands for a header of a word and a symbol: `x` of `Weg x`. An axis behind
/// another word than a place, as in `acceleration x`, is no symbol.
fn symbol(name: &str) -> Option<&str> {
    let mut words = name.split_whitespace().rev();
    let (last, before) = (words.next()?, words.next()?);
    let axis = matches!(last, "x" | "y" | "z" | "X" | "Y" | "Z");
    let place = ["position", "displacement", "height"];
    let word = quantity(&before.to_lowercase());
    let stands = is_symbol(last) && before.chars().count() > 2 && words.next().is_none();
    (stands && (!axis || place.contains(&word.as_str()))).then_some(last)
}

/// Whether what stands before an axis can be the name of a body: no word of it is a quantity.
fn is_body(name: &str) -> bool {
    const QUANTITY_WORDS: &[&str] = &[
        "position",
        "pos",
        "displacement",
        "height",
        "velocity",
        "vel",
        "v",
        "d",
        "p",
        "a",
        "f",
        "acc",
        "acceleration",
        "accel",
        "accelerometer",
        "beschleunigung",
        "accélération",
        "aceleración",
        "force",
        "momentum",
        "gyro",
        "gyroscope",
        "rate",
        "angular",
        "angle",
        "rotation",
        "orientation",
        "magnetic",
        "magnetometer",
        "field",
        "compass",
        "linear",
        "gravity",
        "omega",
        "theta",
        "sigma",
        "err",
        "error",
        "delta",
        "current",
        "voltage",
        "torque",
        "x",
        "y",
        "z",
        "u",
        "s",
        "q",
        "unc",
        "std",
        "angular_velocity",
    ];
    name.len() > 1
        && !words(name).iter().any(|word| {
            let word = quantity(word);
            QUANTITY_WORDS.contains(&word.as_str()) || ERRORS.contains(&word.as_str())
        })
}

fn is_symbol(word: &str) -> bool {
    let mut letters = word.chars();
    letters.next().is_some_and(char::is_alphabetic)
        && letters.all(|c| c.is_ascii_digit() || c == '_')
}

/// A name in small letters, in the words of the tables here.
fn key_of(name: &str) -> String {
    let lower =
        name.trim().to_lowercase().replace(['{', '}', '\\'], "").replace('/', "_").replace('.', "");
    let joined = lower.split_whitespace().collect::<Vec<_>>().join("_");
    let whole = quantity(&joined);
    if whole != joined {
        return whole;
    }
    if let (Some(_), Some((word, last))) = (symbol(name), joined.rsplit_once('_'))
        && !matches!(last, "x" | "y" | "z")
    {
        return quantity(word);
    }
    // `Winkel 1` and `velocity_x`: the first word may be one of the table.
    match joined.split_once('_') {
        Some((first, rest)) => format!("{}_{rest}", quantity(first)),
        None => {
            let stem = joined.trim_end_matches(|c: char| c.is_ascii_digit());
            let index = joined.get(stem.len()..).unwrap_or_default();
            format!("{}{index}", quantity(stem))
        }
    }
}

/// Name and unit of a header whose unit is in no bracket at its end: `t/s`, `Zeit in s`, `time, s`,
/// `x (m) above ground`, `t_ms`.
fn unit_in(name: &str) -> (String, Option<String>) {
    let whole = || (name.to_string(), None);
    match name.to_lowercase().as_str() {
        "millis" | "milliseconds" | "millisekunden" => {
            return (name.to_string(), Some("ms".to_string()));
        }
        "seconds" | "sekunden" | "secondes" | "segundos" => {
            return (name.to_string(), Some("s".to_string()));
        }
        _ => {}
    }
    for (open, close) in [('(', ')'), ('[', ']'), ('{', '}'), ('<', '>')] {
        let Some((before, rest)) = name.split_once(open) else { continue };
        let Some((inside, behind)) = rest.split_once(close) else { continue };
        if let Some(unit) = known_unit(inside) {
            let name = format!("{} {}", before.trim(), behind.trim());
            return (name.trim().to_string(), Some(unit));
        }
    }
    // A letter that is a name more often than a unit.
    let rare =
        |unit: &str| matches!(unit, "L" | "T" | "H" | "F" | "C" | "K" | "t" | "u" | "d" | "h");
    if let Some(unit) = name.strip_prefix("in ").and_then(known_unit) {
        return (name.to_string(), Some(unit));
    }
    for mark in [" in ", " en ", ", ", "/", ";"] {
        if let Some((before, unit)) = name.split_once(mark)
            && !before.trim().is_empty()
            && !rare(unit.trim())
            && let Some(unit) = known_unit(unit)
        {
            return (before.trim().to_string(), Some(unit));
        }
    }
    let ends = name.rsplit_once('_').or_else(|| name.rsplit_once(' '));
    if let Some((before, unit)) = ends.filter(|(before, _)| !before.is_empty()) {
        let time = TIMES.contains(&before.to_lowercase().as_str());
        let last = words(before).last().map_or_else(String::new, |word| quantity(word));
        let one = match unit {
            "rpm" | "Hz" => true,
            "V" => last == "voltage",
            "A" => last == "current",
            "N" => last == "force",
            "s" => time,
            "ms" | "us" | "ns" | "sec" | "min" | "mm" | "cm" | "km" | "deg" | "rad" | "dps"
            | "mps" | "px" | "mN" | "Nm" | "mV" | "mA" | "degrees" | "degree" | "seconds"
            | "millis" | "meters" | "volts" => true,
            // `x_m` is a length in metres, `mass_m` a mass.
            "m" => matches!(before.to_lowercase().as_str(), "x" | "y" | "z" | "position" | "pos"),
            _ => false,
        };
        if let Some(unit) = known_unit(unit).filter(|_| one) {
            return (before.to_string(), Some(unit));
        }
    }
    // Units of two words: `omega_rad_s`, `v_mm_s`.
    for (end, unit) in [
        ("_rad_s", "rad/s"),
        ("_deg_s", "deg/s"),
        ("_rad_per_s", "rad/s"),
        ("_m_s", "m/s"),
        ("_mm_s", "mm/s"),
        ("_cm_s", "cm/s"),
        ("_m_per_s", "m/s"),
    ] {
        if let Some(before) = name.strip_suffix(end).filter(|before| !before.is_empty()) {
            return (before.to_string(), Some(unit.to_string()));
        }
    }
    whole()
}
