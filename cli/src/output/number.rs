//! Numbers as people read them. JSON output never passes through here: it keeps every digit.

/// A measured value: four digits behind the point near one, fewer for large ones, powers of ten at the extremes.
pub fn number(value: f64) -> String {
    let size = value.abs();
    match size {
        _ if value.is_nan() => "nan".into(),
        _ if value.is_infinite() => if value > 0.0 { "inf" } else { "-inf" }.into(),
        0.0 => "0".into(),
        _ if !(1e-3..1e7).contains(&size) => format!("{value:.2e}"),
        _ if value == value.trunc() => format!("{value:.0}"),
        _ if size < 10.0 => format!("{value:.4}"),
        _ if size < 1000.0 => format!("{value:.3}"),
        _ => format!("{value:.1}"),
    }
}

/// A time span, from nanoseconds to days.
pub fn span(seconds: f64) -> String {
    let size = seconds.abs();
    match size {
        _ if !seconds.is_finite() => "-".into(),
        0.0 => "0 s".into(),
        _ if size < 1e-6 => format!("{:.0} ns", seconds * 1e9),
        _ if size < 9.995e-6 => format!("{:.2} µs", seconds * 1e6),
        _ if size < 99.95e-6 => format!("{:.1} µs", seconds * 1e6),
        _ if size < 999.5e-6 => format!("{:.0} µs", seconds * 1e6),
        _ if size < 9.995e-3 => format!("{:.2} ms", seconds * 1e3),
        _ if size < 99.95e-3 => format!("{:.1} ms", seconds * 1e3),
        _ if size < 0.9995 => format!("{:.0} ms", seconds * 1e3),
        _ if size < 99.95 => format!("{seconds:.1} s"),
        _ if size < 5400.0 => format!("{:.0} min", seconds / 60.0),
        _ if size < 172_800.0 => format!("{:.1} h", seconds / 3600.0),
        _ => format!("{:.0} days", seconds / 86_400.0),
    }
}

/// A rate.
pub fn rate(hz: f64) -> String {
    match hz {
        _ if !hz.is_finite() => "-".into(),
        _ if hz >= 1e5 => format!("{:.0} kHz", hz / 1e3),
        _ if hz >= 1e3 => format!("{:.2} kHz", hz / 1e3),
        _ if hz >= 100.0 => format!("{hz:.0} Hz"),
        _ if hz >= 10.0 => format!("{hz:.1} Hz"),
        _ => format!("{hz:.2} Hz"),
    }
}

/// An amount of memory.
pub fn bytes(count: u64) -> String {
    let size = count as f64;
    match count {
        0..1024 => format!("{count} B"),
        1024..1_048_576 => format!("{:.1} KiB", size / 1024.0),
        1_048_576..1_073_741_824 => format!("{:.1} MiB", size / 1_048_576.0),
        _ => format!("{:.1} GiB", size / 1_073_741_824.0),
    }
}

/// So many things: `1 node`, `2 nodes`.
pub fn count(number: usize, thing: &str) -> String {
    if number == 1 { format!("1 {thing}") } else { format!("{number} {thing}s") }
}

/// A speed, always with its sign's place kept, so that it does not jump about on a screen.
pub fn metres_per_second(value: f64) -> String {
    if value.is_finite() { format!("{value:5.2} m/s") } else { "    - m/s".into() }
}

/// A time span as people type it: `90`, `90s`, `250ms`, `5min`, `1.5h`. The reason why it is none otherwise.
pub fn parse_seconds(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let split = text.find(|c: char| c.is_ascii_alphabetic() || c == 'µ').unwrap_or(text.len());
    let (digits, unit) = text.split_at(split);
    let factor = match unit.trim() {
        "" | "s" | "sec" => 1.0,
        "us" | "µs" => 1e-6,
        "ms" => 1e-3,
        "m" | "min" => 60.0,
        "h" => 3600.0,
        _ => return Err(format!("\"{text}\" is no time: \"{unit}\" is no unit; write 90s, 250ms, 5min or 1.5h")),
    };
    match digits.trim().parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value * factor),
        Ok(value) => Err(format!("\"{text}\" is no time: {value} is not above 0")),
        Err(_) => Err(format!("\"{text}\" is no time: write 90s, 250ms, 5min or 1.5h")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_keep_as_many_digits_as_people_can_use() {
        let shown = [0.0, 1.0, -3.0, 0.123_456, 12.345_67, 1234.56, 0.000_04, 2.5e9, f64::NAN, f64::NEG_INFINITY];
        assert_eq!(
            shown.map(number),
            ["0", "1", "-3", "0.1235", "12.346", "1234.6", "4.00e-5", "2.50e9", "nan", "-inf"]
        );
    }

    #[test]
    fn spans_take_the_unit_that_fits() {
        let shown = [3e-8, 1.5e-6, 4.2e-5, 9.9996e-5, 3e-4, 2.5e-3, 0.05, 0.25, 0.9999, 12.34, 600.0, 7200.0, 4e5];
        assert_eq!(
            shown.map(span),
            [
                "30 ns", "1.50 µs", "42.0 µs", "100 µs", "300 µs", "2.50 ms", "50.0 ms", "250 ms", "1.0 s", "12.3 s",
                "10 min", "2.0 h", "5 days"
            ]
        );
        assert_eq!(span(f64::INFINITY), "-");
    }

    #[test]
    fn rates_and_sizes_read_as_people_say_them() {
        assert_eq!([1.0, 10.04, 250.0, 2500.0].map(rate), ["1.00 Hz", "10.0 Hz", "250 Hz", "2.50 kHz"]);
        assert_eq!([12, 2048, 3 << 20, 5 << 30].map(bytes), ["12 B", "2.0 KiB", "3.0 MiB", "5.0 GiB"]);
    }

    #[test]
    fn one_thing_is_no_things() {
        assert_eq!([0, 1, 2].map(|n| count(n, "wire")), ["0 wires", "1 wire", "2 wires"]);
    }

    #[test]
    fn times_are_read_with_or_without_a_unit() {
        for (text, seconds) in [("90", 90.0), ("90s", 90.0), ("250ms", 0.25), (" 5 min ", 300.0), ("1.5h", 5400.0)] {
            assert_eq!(parse_seconds(text), Ok(seconds), "{text}");
        }
    }

    #[test]
    fn what_is_no_time_says_how_to_write_one() {
        for text in ["", "x", "-3s", "0", "nan", "inf", "5 parsecs", "1e999"] {
            let reason = parse_seconds(text).unwrap_err();
            assert!(reason.contains("is no time"), "{text}: {reason}");
        }
    }
}
