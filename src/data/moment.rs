//! Clock times and dates as seconds, in the digits of the file.

/// Seconds of a day.
const DAY: i64 = 86_400;

/// In which order a date has its numbers, where its form does not say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    MonthFirst,
    DayFirst,
}

/// A clock time, a date, or both.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Moment {
    /// Days since 1970, where there is a date.
    pub days: Option<i64>,
    /// Whether there is a clock time.
    pub clock: bool,
    /// Whole seconds of the day.
    pub seconds: i64,
    /// The digits behind the decimal sign of the seconds.
    pub fraction: String,
    /// The first two numbers of a date such as 3/1/2023, where its form does not say their order.
    pub open: Option<(i64, i64)>,
}

impl Moment {
    /// As seconds, a decimal number: since midnight, or since 1970 where there is a date.
    pub(super) fn text(&self, more_days: i64) -> String {
        let whole = (self.days.unwrap_or(0) + more_days) * DAY + self.seconds;
        let point = if self.fraction.is_empty() { "" } else { "." };
        format!("{whole}{point}{}", self.fraction)
    }
}

/// Reads `10:00:00.1`, `2023-03-01T10:00:00Z`, `01.03.2023 10:00:00,1`, `3/1/2023 2:05:07 PM` and
/// their like.
pub(super) fn moment(cell: &str, order: Order) -> Option<Moment> {
    let cell = cell.trim();
    if !cell.starts_with(|c: char| c.is_ascii_digit()) || cell.len() > 40 {
        return None;
    }
    let upper = cell.to_uppercase();
    let (text, afternoon) = match ["AM", "A.M.", "PM", "P.M."]
        .iter()
        .find_map(|mark| Some((upper.strip_suffix(mark)?, mark.starts_with('P'))))
    {
        Some((rest, afternoon)) => (rest.trim().to_string(), Some(afternoon)),
        None => (upper, None),
    };
    let (date, clock) = match text.split_once(':') {
        Some((before, _)) => match before.rfind(['T', ' ', '_']) {
            Some(at) => (text.get(..at), text.get(at + 1..)?),
            None => (None, text.as_str()),
        },
        None => (Some(text.as_str()), ""),
    };
    let mut out = Moment {
        days: None,
        clock: !clock.is_empty(),
        seconds: 0,
        fraction: String::new(),
        open: None,
    };
    if out.clock {
        (out.seconds, out.fraction) = seconds(clock.trim(), afternoon)?;
    }
    if let Some(date) = date {
        let (days, open) = days(date.trim().trim_end_matches(','), order)?;
        out.days = Some(days);
        out.open = open;
    }
    Some(out)
}

/// Seconds of a clock time: whole, and the digits of the rest.
fn seconds(clock: &str, afternoon: Option<bool>) -> Option<(i64, String)> {
    // What says how far the zone is from Greenwich comes behind the seconds.
    let (clock, zone) = match clock.strip_suffix('Z') {
        Some(clock) => (clock, 0),
        None => match clock.char_indices().find(|(_, c)| matches!(c, '+' | '-')) {
            Some((at, sign)) => {
                let zone = clock.get(at + 1..)?.replace(':', "");
                if zone.len() != 4 && zone.len() != 2 {
                    return None;
                }
                let hours = digits(zone.get(..2)?)?;
                let minutes =
                    zone.get(2..).filter(|rest| !rest.is_empty()).map_or(Some(0), digits)?;
                let east = 3600 * hours + 60 * minutes;
                (clock.get(..at)?.trim_end(), if sign == '+' { east } else { -east })
            }
            None => (clock, 0),
        },
    };
    let (whole, fraction) = clock.split_once(['.', ',']).unwrap_or((clock, ""));
    if !fraction.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let parts: Vec<&str> = whole.split(':').collect();
    if parts.iter().skip(1).any(|part| part.len() != 2) {
        return None;
    }
    let parts: Vec<i64> = parts.into_iter().map(digits).collect::<Option<_>>()?;
    let (hours, minutes, seconds) = match parts.as_slice() {
        [hours, minutes, seconds] => (*hours, *minutes, *seconds),
        [minutes, seconds] if !fraction.is_empty() => (0, *minutes, *seconds),
        [hours, minutes] => (*hours, *minutes, 0),
        _ => return None,
    };
    let hours = match afternoon {
        Some(true) if hours < 12 => hours + 12,
        Some(false) if hours == 12 => 0,
        _ => hours,
    };
    if minutes > 59 && parts.len() > 2 || seconds > 60 {
        return None;
    }
    Some((3600 * hours + 60 * minutes + seconds - zone, fraction.to_string()))
}

fn digits(text: &str) -> Option<i64> {
    let plain = !text.is_empty() && text.len() < 7 && text.bytes().all(|b| b.is_ascii_digit());
    if plain { text.parse().ok() } else { None }
}

/// The first letters of the months in English, German, French and Spanish.
const MONTHS: [&[&str]; 12] = [
    &["JAN", "ENE"],
    &["FEB", "FÉV", "FEV"],
    &["MAR", "MÄR", "MRZ"],
    &["APR", "AVR", "ABR"],
    &["MAY", "MAI"],
    &["JUN", "JUIN"],
    &["JUL", "JUIL"],
    &["AUG", "AOÛ", "AGO"],
    &["SEP"],
    &["OCT", "OKT"],
    &["NOV"],
    &["DEC", "DEZ", "DÉC", "DIC"],
];

/// Days since 1970 of a date.
fn days(date: &str, order: Order) -> Option<(i64, Option<(i64, i64)>)> {
    let parts: Vec<&str> =
        date.split(['-', '/', '.', ' ']).map(str::trim).filter(|part| !part.is_empty()).collect();
    let [first, second, third] = parts.as_slice() else { return None };
    let named = |text: &str| {
        let is = |names: &&[&str]| names.iter().any(|name| text.starts_with(name));
        MONTHS.iter().position(is).and_then(|at| i64::try_from(at + 1).ok())
    };
    let mut open = None;
    let (year, month, day) = if first.len() == 4 {
        (digits(first)?, digits(second).or_else(|| named(second))?, digits(third)?)
    } else if let Some(month) = named(second) {
        (digits(third)?, month, digits(first)?)
    } else {
        let (first, second) = (digits(first)?, digits(second)?);
        let by_form = date.contains('.') || first > 12;
        let month_first = !by_form && (second > 12 || order == Order::MonthFirst);
        open = (!date.contains('.')).then_some((first, second));
        let (month, day) = if month_first { (first, second) } else { (second, first) };
        (digits(third)?, month, day)
    };
    let year = if year < 100 { 2000 + year } else { year };
    if !(1..=12).contains(&month) || !(1..=31).contains(&day) {
        return None;
    }
    Some((civil(year, month, day), open))
}

/// Days from 1 January 1970 to a day of the Gregorian calendar. Years are counted from March, so
/// that the day that comes every four years is the last.
fn civil(year: i64, month: i64, day: i64) -> i64 {
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let leaps = year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    // 153 days are five months from March on.
    365 * year + leaps + (153 * month + 2) / 5 + day - 1 - 719_468
}

/// A column of clock times or dates as seconds, with a word for what they count from; none where a
/// cell that is not missing is anything else.
pub(super) fn seconds_of<'a>(
    cells: impl Iterator<Item = &'a str> + Clone,
    missing: impl Fn(&str) -> bool,
) -> Option<(Vec<String>, &'static str)> {
    let present = || cells.clone().filter(|cell| !missing(cell));
    let first = moment(present().next()?, Order::MonthFirst)
        .or_else(|| moment(present().next()?, Order::DayFirst))?;
    let mut order = Order::MonthFirst;
    if first.open.is_some() {
        let day_first = |cell: &str| {
            let first = cell.split(['/', '-']).next().and_then(digits);
            first.is_some_and(|number| number > 12)
        };
        if present().any(day_first) {
            order = Order::DayFirst;
        }
    }
    let (mut out, mut more, mut last, mut changes, mut count) = (Vec::new(), 0, None, 0, 0);
    for cell in cells.clone() {
        if missing(cell) {
            out.push(String::new());
            continue;
        }
        let here = moment(cell, order)?;
        if here.days.is_some() != first.days.is_some() || here.clock != first.clock {
            return None;
        }
        count += 1;
        let since = here.days.unwrap_or(0) * DAY + here.seconds;
        if let Some(last) = last {
            changes += usize::from(since != last);
            // Past midnight a clock without a date begins again.
            if here.days.is_none() && last - since > DAY / 2 {
                more += 1;
            }
        }
        last = Some(since);
        out.push(here.text(more));
    }
    // A date that stays the same tells when it was, not what happened when.
    if !first.clock && 2 * changes < count {
        return None;
    }
    Some((out, if first.days.is_some() { "since 1970" } else { "since midnight" }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_read_in_their_usual_forms() {
        let noon = 19_417 * DAY + 12 * 3600;
        let rows = [
            ("00:00:00.1", Some("0.1".to_string())),
            ("1:02:03", Some("3723".to_string())),
            ("02:03.50", Some("123.50".to_string())),
            ("2023-03-01T12:00:00.25Z", Some(format!("{noon}.25"))),
            ("2023-03-01 13:00:00+01:00", Some(noon.to_string())),
            ("01.03.2023 12:00:00,5", Some(format!("{noon}.5"))),
            ("3/1/2023 12:00:00 PM", Some(noon.to_string())),
            ("1-Mar-2023 12:00:00", Some(noon.to_string())),
            ("2023/03/01 12:00", Some(noon.to_string())),
            ("1970-01-02", Some("86400".to_string())),
            ("2000-02-30x", None),
            ("1.5", None),
            ("run 1", None),
            ("12 s", None),
            ("1:2", None),
        ];
        for (text, expected) in rows {
            let found = moment(text, Order::MonthFirst).map(|m| m.text(0));
            assert_eq!(found, expected, "{text}");
        }
    }

    #[test]
    fn clocks_go_on_past_midnight() {
        let cells = ["23:59:59.5", "", "00:00:00.5"];
        let (seconds, _) = seconds_of(cells.into_iter(), str::is_empty).unwrap();
        assert_eq!(seconds, ["86399.5", "", "86400.5"]);
        assert_eq!(seconds_of(["10:00", "x"].into_iter(), str::is_empty), None);
        let dates = ["2023-03-01"; 4];
        assert_eq!(seconds_of(dates.into_iter(), str::is_empty), None);
    }
}
