//! How people and instruments write the tops of their tables: `new` writes a spec for each, and
//! `check` accepts it.

use std::fs;

use crate::support::program::{good, json, run};

/// A habit: what the file is called, what stands above, between and below its rows, how a row is
/// written, and what the spec then says.
struct Habit {
    what: &'static str,
    file: &'static str,
    above: &'static str,
    row: fn(usize) -> String,
    below: &'static str,
    says: &'static [&'static str],
}

fn time(at: usize) -> f64 {
    at as f64 / 10.0
}

fn place(at: usize) -> f64 {
    time(at).cos()
}

fn speed(at: usize) -> f64 {
    -time(at).sin()
}

fn tabs(at: usize) -> String {
    format!("{:.1}\t{:.6}", time(at), place(at))
}

fn commas(at: usize) -> String {
    format!("{:.1},{:.6}", time(at), place(at))
}

fn three(at: usize) -> String {
    format!("{:.1},{:.6},{:.6}", time(at), place(at), speed(at))
}

fn four(at: usize) -> String {
    format!("{:.1},{:.6},{:.6},{:.3}", time(at), place(at), speed(at), 20.0 + time(at))
}

fn german(at: usize) -> String {
    format!("{:.1};{:.6};{:.6}", time(at), place(at), speed(at)).replace('.', ",")
}

const fn habit(
    what: &'static str,
    above: &'static str,
    row: fn(usize) -> String,
    says: &'static [&'static str],
) -> Habit {
    Habit { what, file: "d.txt", above, row, below: "", says }
}

const HABITS: &[Habit] = &[
    // What stands above the header.
    habit(
        "comments",
        "# lab book 4\n# swing 2\nt\ttheta\n",
        tabs,
        &["time t ", "coordinates theta"],
    ),
    habit("a header in a comment", "% run 7\n% t theta\n", tabs, &["time t ", "coordinates theta"]),
    habit(
        "lines of metadata",
        "Sampling rate: 10 Hz\nDate: 2021-05-04\n\nt\ttheta\n",
        tabs,
        &["time t ", "coordinates theta", "2 lines above the header left out, up to line 2"],
    ),
    habit(
        "metadata between commas",
        "Mass,0.25\nLength,1.5\nOperator,AB\n\ntime (s),x (m),v (m/s)\n",
        three,
        &["time \"time\" [s]", "coordinates x [m]", "velocities  v [m/s]"],
    ),
    habit("the name of a body above", "mass_C\nt\tx\n", tabs, &["time t ", "coordinates x"]),
    habit(
        "bodies in merged cells",
        ",mass_A,,mass_B,\nt,x,y,x,y\n",
        |at| {
            format!("{:.1},{:.5},{:.5},{:.5},{:.5}", time(at), place(at), speed(at), 2.0, time(at))
        },
        &["x_mass_A = \"mass_A: x\"", "y_mass_B = \"mass_B: y\""],
    ),
    habit(
        "the name of a run above",
        "Run #3\t\nTime (s)\tAngle (rad)\n",
        tabs,
        &["time Time [s]", "coordinates Angle [rad]", "cos(Angle)"],
    ),
    habit(
        "the header of a measurement program",
        "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDate\t2021/05/04\n\
         Time\t10:11:12.5\n***End_of_Header***\t\n\t\nChannels\t1\t\nSamples\t14\t\n\
         X0\t0.0000E+0\t\nDelta_X\t0.100000\t\n***End_of_Header***\t\t\nX_Value\tAngle\tComment\n",
        tabs,
        &["time X_Value", "coordinates Angle"],
    ),
    habit(
        "long names, short names and units",
        "Vernier Format 3\nrig 5/4/2021 12:51:07\nSwing\nTime since start\tPosition of cart\nT\tX\ns\tm\n\n",
        tabs,
        &["[s]", "coordinates X [m]"],
    ),
    habit("a line under the header", "t,x,v\n---,---,---\n", three, &["velocities  v"]),
    habit("a first line about the delimiter", "sep=,\nt,x,v\n", three, &["velocities  v"]),
    // Units.
    habit("a row of units", "Time\tAngle\ns\trad\n", tabs, &["time Time [s]", "Angle [rad]"]),
    habit("a row of units in brackets", "t,x,v\n(s),(m),(m/s)\n", three, &["x [m]", "v [m/s]"]),
    habit("units in words", "x-axis,1,2\nsecond,Meter,m/s\n", three, &["time \"x-axis\" [s]"]),
    habit(
        "a slash",
        "Zeit t / s\tWinkel φ / °\n",
        tabs,
        &["time \"Zeit t\" [s]", "φ [rad]", "[deg]"],
    ),
    habit("a slash without blanks", "t/s,x/mm,v/mm/s\n", three, &["x [mm]", "v [mm/s]", "[s]"]),
    habit("any bracket", "time {s},x <m>,v [m/s]\n", three, &["x [m]", "v [m/s]"]),
    habit("behind a comma", "\"Time, s\",\"x, m\",\"v, m/s\"\n", three, &["x [m]", "v [m/s]"]),
    habit("a word between", "Zeit in s,Weg in m\n", commas, &["time \"Zeit in s\" [s]", "Weg [m]"]),
    habit(
        "underscores",
        "t_ms,x_mm\n",
        |at| format!("{},{:.5}", 100 * at, place(at)),
        &["time t_ms [ms]", "time t [s]", "coordinates x [mm]", "p_x [mm/s]"],
    ),
    habit("powers and points", "t (s),x (m),v (m·s⁻¹)\n", three, &["velocities  v [m/s]"]),
    habit(
        "milliseconds and degrees",
        "t (ms)\tangle (°)\n",
        |at| format!("{}\t{:.4}", 100 * at, 30.0 * place(at)),
        &[
            "coordinates angle [rad]",
            "p_angle [rad/s]",
            "time t [s]",
            "time t [ms]  angle = angle [deg]",
        ],
    ),
    habit(
        "other units of a velocity",
        "t [ms],x [mm],v [m/s]\n",
        |at| format!("{},{:.5},{:.7}", 100 * at, place(at), speed(at) / 1000.0),
        &["coordinates x [mm]", "velocities  v [mm/s]", "v = v [m/s]"],
    ),
    habit(
        "symbols behind words",
        "Zeit t / s;Weg x / m;Geschwindigkeit v / m/s\n",
        german,
        &["time \"Zeit t\" [s]", "coordinates x [m]", "velocities  v [m/s]"],
    ),
    // Words.
    habit(
        "Spanish",
        "tiempo [s],posición [m],velocidad [m/s]\n",
        three,
        &["posición [m]", "velocidad [m/s]"],
    ),
    habit(
        "French",
        "Temps (s);Élongation (m);Vitesse (m/s)\n",
        german,
        &["Élongation [m]", "Vitesse [m/s]"],
    ),
    habit(
        "German",
        "Zeit [s];Auslenkung [mm];Geschwindigkeit [mm/s]\n",
        german,
        &["Auslenkung [mm]", "Geschwindigkeit [mm/s]"],
    ),
    habit(
        "a data set before a colon",
        "Latest: Time (s),Latest: Position (m),Latest: Velocity (m/s)\n",
        three,
        &["Position [m]", "Velocity [m/s]"],
    ),
    habit(
        "a run behind the unit",
        "Time (s) Run #1,Position (m) Run #1,Velocity (m/s) Run #1\n",
        three,
        &["Position [m]", "Velocity [m/s]"],
    ),
    habit(
        "runs side by side",
        "Run 1: Time (s),Run 1: Position (m),Run 2: Time (s),Run 2: Position (m)\n",
        |at| format!("{:.1},{:.5},{:.1},{:.5}", time(at), place(at), time(at), speed(at)),
        &["`Run 2: Position (m)` belongs to another run. Left out."],
    ),
    habit(
        "the same name twice",
        "t,x,t,x\n",
        |at| format!("{:.1},{:.5},{:.1},{:.5}", time(at), place(at), time(at), speed(at)),
        &["\"t (column 1)\"", "\"x (column 2)\""],
    ),
    habit(
        "axes",
        "Time (s),Position x (m),Position y (m),Velocity x (m/s),Velocity y (m/s)\n",
        |at| {
            format!(
                "{:.1},{:.5},{:.5},{:.5},{:.5}",
                time(at),
                place(at),
                speed(at),
                speed(at),
                -place(at)
            )
        },
        &["coordinates x [m], y [m]", "velocities  Velocity_x [m/s], Velocity_y [m/s]"],
    ),
    // Columns that are no coordinates.
    habit(
        "errors",
        "t [s],x [m],x_err [m],sigma_x [m],±\n",
        |at| format!("{:.1},{:.5},0.01,0.01,0.01", time(at), place(at)),
        &[
            "x = x error x_err",
            "`sigma_x [m]` holds the errors of x. Left out.",
            "`±`",
            "coordinates x [m]",
        ],
    ),
    habit(
        "something else",
        "t [s],x [m],v [m/s],Temp [°C]\n",
        four,
        &["# is `Temp [°C]` something that moves? Left out."],
    ),
    habit(
        "a force",
        "t (s),x (m),v (m/s),F (N)\n",
        four,
        &["input F [N] { linear }", "force x += span{ F }"],
    ),
    habit(
        "a voltage",
        "time,theta,omega,U / V\n",
        four,
        &["input U { linear }", "force theta += span{ U }"],
    ),
    habit("a command", "t,x,v,u\n", four, &["input u { linear }"]),
    habit(
        "a torque by its unit",
        "t [s],theta [rad],omega [rad/s],M [Nm]\n",
        four,
        &["does `M [Nm]` drive"],
    ),
    habit(
        "one column of many",
        "t,x,v,note\n",
        |at| format!("{},free", three(at)),
        &["`note` holds no numbers"],
    ),
    habit(
        "nothing that looks like a coordinate",
        "t,signal,other\n",
        three,
        &["is this what moves?"],
    ),
    // Times.
    habit(
        "frames",
        "frame\ttheta\n",
        |at| format!("{at}\t{:.6}", place(at)),
        &["time frame", "how many of it are a second?"],
    ),
    habit(
        "an index and a time",
        "Nr.,t (s),x (m)\n",
        |at| format!("{at},{}", commas(at)),
        &["time t [s]", "`Nr.` is another time"],
    ),
    habit(
        "clock times",
        "time\ttheta\n",
        |at| format!("00:00:{:04.1}\t{:.6}", time(at), place(at)),
        &["time \"time\"", "since midnight"],
    ),
    habit(
        "dates",
        "time,x\n",
        |at| format!("2023-03-01T10:00:{:06.3}Z,{:.6}", time(at), place(at)),
        &["time \"time\"", "since 1970"],
    ),
    habit(
        "dates with a blank",
        "DateTime;X;Y\n",
        |at| format!("2021-01-01 12:00:{:05.2};{:.4};{:.4}", time(at), place(at), speed(at)),
        &["time DateTime", "coordinates X"],
    ),
    habit(
        "German dates",
        "Datum;x\n",
        |at| {
            format!("01.03.2023 10:00:{:04.1};{:.5}", time(at), place(at))
                .replace(";1.", ";1,")
                .replace("0.", "0,")
        },
        &["time Datum"],
    ),
    habit(
        "afternoons",
        "Time,x\n",
        |at| format!("3/1/2023 2:05:{:04.1} PM,{:.5}", time(at), place(at)),
        &["time Time"],
    ),
    habit(
        "a date and a clock",
        "Date,Time,x\n",
        |at| format!("2023-03-01,10:00:{:04.1},{:.5}", time(at), place(at)),
        &["time Time", "`Date` holds no numbers"],
    ),
    // Cells and what is below.
    Habit {
        below: "\nMean\t0.1\nStd\t0.2\n",
        ..habit("sums below", "t\ttheta\n", tabs, &["time t", "2 lines below the table left out"])
    },
    Habit {
        below: "\nEnd of data\n",
        ..habit("a last line", "t,x,v\n", three, &["1 line below the table"])
    },
    habit(
        "dashes",
        "t,x\n",
        |at| if at == 5 { "0.5,--.---".to_string() } else { commas(at) },
        &["coordinates x"],
    ),
    habit(
        "stars",
        "t\tx\n",
        |at| if at == 5 { "0.5\t1.2*".to_string() } else { tabs(at) },
        &["1 cell of `x` marked as doubtful"],
    ),
    habit(
        "overload",
        "t,x\n",
        |at| if at == 5 { "0.5,OVERLOAD".to_string() } else { commas(at) },
        &["coordinates x"],
    ),
    habit("no header", "", three, &["\"column 1\"", "\"column 2\""]),
    habit(
        "the header again before every run",
        "t\tx\n",
        |at| if at == 7 { format!("second run\nt\tx\n{}", tabs(0)) } else { tabs(at % 7) },
        &["run run"],
    ),
    // Loggers, oscilloscopes and cameras.
    habit(
        "names, units and processing",
        "\"TOA9\",\"rig\",\"L1\"\n\"TIMESTAMP\",\"RECORD\",\"Angle\"\n\"TS\",\"RN\",\"Rad\"\n\"\",\"\",\"Smp\"\n",
        |at| format!("\"2021-05-04 10:00:{:05.2}\",{at},{:.5}", time(at), place(at)),
        &["time TIMESTAMP", "coordinates Angle", "`RECORD` is another time, or a count"],
    ),
    habit(
        "names, descriptions and units",
        "Zeit;Weg;Kanal\nseit Beginn;des Wagens;frei\ns;mm;V\n",
        german,
        &["time Zeit [s]", "coordinates Weg [mm]", "does `Kanal` drive"],
    ),
    habit("units as names", "in s,C1 in V\n", commas, &["time \"in s\""]),
    habit("x-axis and second", "x-axis,1\nsecond,Volt\n", commas, &["time \"x-axis\""]),
    habit(
        "an end mark",
        "Name,Scope\nTime,Position\n[ms],[mm]\n",
        |at| format!("{},{:.4}", 100 * at, place(at)),
        &["time Time [ms]", "Position [mm]"],
    ),
    habit(
        "seconds since 1970",
        "time,seconds_elapsed,x,y\n",
        |at| {
            let since = 1_620_000_000_000_000_000_i64 + 100_000_000 * at as i64;
            format!("{since},{:.1},{:.4},{:.4}", time(at), place(at), speed(at))
        },
        &["coordinates x", "is another time"],
    ),
    habit(
        "days of a sheet",
        "Date;x\n",
        |at| format!("{:.8};{:.5}", 44_986.5 + time(at) / 86_400.0, place(at)),
        &["time Date", "as large as dates are in [day]"],
    ),
    habit(
        "markers of a camera",
        "NO_OF_FRAMES\t14\nFREQUENCY\t10\nMARKER_NAMES\tknee\n\nFrame\tTime\tknee X\tknee Y\n",
        |at| format!("{at}\t{}\t{:.4}", tabs(at), speed(at)),
        &["time Time", "coordinates X, Y", "`Frame` is another time"],
    ),
    habit(
        "stars for what is missing",
        "Time,x\n",
        |at| if at == 4 { "0.4,*****".to_string() } else { commas(at) },
        &["coordinates x"],
    ),
    habit(
        "segments of an oscilloscope",
        "SCOPE9,12345\nSegments,1,SegmentSize,14\nSegment,TrigTime,Since\n#1,21 Mar 2021 9:37:08,0.0\nTime,Ampl\n",
        commas,
        &["time Time", "coordinates Ampl"],
    ),
    habit(
        "a header in lines of comments",
        "# rig 3\n#\n# Time [s], Position [m]\n",
        commas,
        &["time Time [s]", "Position [m]"],
    ),
    habit(
        "a length and an angle",
        "t [s],r [m],θ [rad]\n",
        three,
        &["coordinates r [m], θ [rad]", "p_θ [m^2/rad^2*rad/s]", "p_θ^2/(2 [m^2/rad^2])"],
    ),
    habit(
        "points between thousands",
        "t;x\n",
        |at| {
            let time = format!("{:.1}", time(at)).replace('.', ",");
            format!("{time};1.{:03},{}", 100 + 5 * at, at % 10)
        },
        &["points between thousands (such as `1.100,0`) taken out", "coordinates x"],
    ),
    habit("quoted names", "\"t\";\"x\";\"v\"\n", german, &["velocities  v"]),
    habit(
        "a phone",
        "\"Time (s)\",\"Gyroscope x (rad/s)\",\"Gyroscope y (rad/s)\"\n",
        three,
        &[
            "coordinates theta [rad]",
            "theta not measured  p_theta not measured  Gyroscope_y = \"Gyroscope y\"",
            "`Gyroscope y (rad/s)` varies most of 2 columns",
            "measure Gyroscope_y [rad/s] = rate(theta)",
            "V = span{ theta^2, theta^3, theta^4, cos(theta) }",
            "is `Gyroscope x (rad/s)` something that moves? Left out.",
        ],
    ),
    habit(
        "a rate in degrees",
        "t_ms,Drehrate [°/s]\n",
        |at| format!("{},{:.5}", 100 * at, 40.0 * speed(at)),
        &["coordinates theta [rad]", "time t [s]", "measure Drehrate [rad/s] = rate(theta)"],
    ),
    habit(
        "a speed alone",
        "time (s),speed (mm/s)\n",
        commas,
        &["coordinates x [mm]", "measure speed [mm/s] = rate(x)", "V = span{ x^2, x^3, x^4 }"],
    ),
    habit(
        "an accelerometer",
        "time,accX,accY\n",
        |at| format!("{:.1},{:.5},{:.5}", time(at), 0.1 * place(at), 9.81 + place(at)),
        &["param at_rest = 10.54", "measure accY = rate(rate(x)) + at_rest", "`accX` something"],
    ),
    habit(
        "an accelerometer in multiples of gravity",
        "time [s],accX [g],accY [mg]\n",
        |at| format!("{:.1},{:.5},{:.5}", time(at), 0.1 * place(at), 1000.0 + 50.0 * place(at)),
        &[
            "coordinates x [m]",
            "accX = accX [g_n]",
            "param at_rest = 0.7188 [m/s^2]",
            "measure accX [m/s^2] = rate(rate(x)) + at_rest",
        ],
    ),
    habit(
        "an angular acceleration in degrees",
        "t [s],Winkelbeschleunigung [deg/s^2]\n",
        |at| format!("{:.1},{:.5}", time(at), 18.0 + 180.0 * (at % 2) as f64),
        &["coordinates theta [rad]", "param at_rest = 1.885 [rad/s^2]"],
    ),
    habit("a speed that is a voltage", "t,Tacho [V]\n", commas, &["coordinates Tacho"]),
    habit(
        "a unit behind an underscore",
        "time_s,theta_deg,omega_deg_s\n",
        three,
        &["theta [rad]", "[deg/s]", "cos(theta)"],
    ),
    habit("bars", "|t|x|v\n", |at| format!("|{}", three(at).replace(',', "|")), &["velocities  v"]),
    habit("derivatives", "t,phi,dphi/dt\n", three, &["coordinates phi", "dphi_dt"]),
    habit(
        "uncertainties",
        "Zeit;Winkel;Unsicherheit Winkel\n",
        german,
        &["holds the errors of winkel. Left out."],
    ),
    habit(
        "uncertainties in other units",
        "t [s],x [mm],± [um],v [mm/s],rel. error v [%]\n",
        |at| format!("{:.1},{:.5},{},{:.5},2", time(at), place(at), at % 7 + 1, speed(at)),
        &["x = x error \"±\" [um]", "`rel. error v [%]` holds the errors of v. Left out."],
    ),
    habit("momenta", "t,q,p\n", three, &["momenta     p", "T = p^2/2"]),
    habit(
        "no time at all",
        "x,v\n",
        |at| format!("{:.5},{:.5}", place(5 * at), speed(5 * at)),
        &["time sample", "How far apart are two samples?", "velocities  v"],
    ),
    habit(
        "columns of blanks",
        "  Time (s)    Angle (rad)\n",
        |at| format!("  {:8.1}    {:.6}", time(at), place(at)),
        &["Angle [rad]"],
    ),
    habit("an empty last column", "t,x,v,\n", |at| format!("{},", three(at)), &["velocities  v"]),
    habit("a column without cells", "t\tx\tComment\n", tabs, &["coordinates x"]),
];

#[test]
fn every_habit_gets_a_spec_that_check_accepts() {
    let mut wrong = Vec::new();
    for habit in HABITS {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path();
        let rows: String = (0..14).map(|at| (habit.row)(at) + "\n").collect();
        fs::write(path.join(habit.file), format!("{}{rows}{}", habit.above, habit.below))
            .expect("written");
        let made = run(path, &["new", habit.file]);
        if made.code != Some(0) {
            wrong.push(format!("{}: {}", habit.what, made.err));
            continue;
        }
        let spec = fs::read_to_string(path.join("d.ham")).expect("a spec");
        for part in habit.says.iter().filter(|part| !spec.contains(*part)) {
            wrong.push(format!("{}: {part} is not in\n{spec}", habit.what));
        }
        let checked = run(path, &["check", "d.ham"]);
        if checked.code != Some(0) || checked.err.contains("clash") {
            wrong.push(format!("{}: {}\n{spec}", habit.what, checked.err));
        }
    }
    assert!(wrong.is_empty(), "{} are wrong:\n{}", wrong.len(), wrong.join("\n\n"));
    assert!(HABITS.len() > 74);
}

#[test]
fn a_wrong_cell_is_told_and_the_spec_is_written() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path();
    for (data, says) in [
        ("run,t,q,p\n1,0,1,0\n1,0.1,x1,0\n1,0.2,0.9,0\n", ["line 3", "`q`", "`x1`"]),
        ("run,t,q,p\n1,0,1,0\n1,0.1 s,1,0\n1,0.2,0.9,0\n", ["line 3", "`t`", "`0.1 s`"]),
    ] {
        fs::write(path.join("d.csv"), data).expect("written");
        let told = good(path, &["new", "d.csv", "--force"]).err;
        let spec = fs::read_to_string(path.join("d.ham")).expect("a spec");
        for part in says {
            assert!(told.contains(part) && spec.contains(part), "{part}: {told}\n{spec}");
        }
    }
}

#[test]
fn a_fit_reads_what_new_understood() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path();
    let rows: String = (0..60)
        .map(|at| format!("{};{:.6}\n", 100 * at, 20.0 * place(at)).replace('.', ","))
        .collect();
    let above = "Versuch;Feder\nDatum;01.03.2023\n\nZeit;Auslenkung\nms;mm\n";
    fs::write(path.join("d.csv"), format!("{above}{rows}Mittelwert;0,1\n")).expect("written");
    good(path, &["new", "d.csv"]);
    let fitted = json(path, &["fit", "d.ham"], "leverrier.fit/1");
    let terms = fitted["model"]["terms"].as_array().expect("terms");
    assert_eq!(terms.len(), 1, "{terms:?}");
    let value = terms[0]["coefficient"].as_f64().expect("a number");
    assert!((value - 0.5).abs() < 1e-3, "{value}");
}

#[test]
fn a_rate_alone_is_fitted_as_one() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path();
    for (header, row) in [
        ("t (ms),Gyroscope z (°/s)", (|at| speed(at).to_degrees()) as fn(usize) -> f64),
        ("t (ms),Acceleration z (m/s^2)", |at| 9.81 - place(at)),
    ] {
        let rows: String = (0..150).map(|at| format!("{},{:.6}\n", 100 * at, row(at))).collect();
        fs::write(path.join("d.csv"), format!("{header}\n{rows}")).expect("written");
        good(path, &["new", "d.csv", "--force"]);
        let fitted = json(path, &["fit", "d.ham"], "leverrier.fit/1");
        let terms = fitted["model"]["terms"].as_array().expect("terms");
        assert_eq!(terms.len(), 1, "{header}: {terms:?}");
        let value = terms[0]["coefficient"].as_f64().expect("a number");
        assert!((value - 0.5).abs() < 1e-3, "{header}: {value}");
    }
}
