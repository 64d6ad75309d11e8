//! The table of rules: the first one that holds names the mode.
//!
//! A mode that was chosen stays for its dwell time, so that a signal about its bound does not make the robot waver. Only
//! a rule that stands above the present one is obeyed at once: what is dangerous stands on top and need not wait. Where
//! no rule holds, the present mode stays.

use super::condition::Condition;
use super::signal::Signals;
use runtime::Time;
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;

/// One rule of the robot file.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RuleConfig {
    /// When it holds, as in "danger > 0.6 and battery_v < 11.5", or "always".
    pub when: String,
    /// Name of the coordinator's mode that it asks for.
    pub mode: String,
    /// How long its mode stays at least, unless a rule above it holds [s].
    #[serde(default = "dwell_s")]
    pub dwell_s: f64,
    /// Periods of nodes while it is obeyed, by instance name, within their `period_ms = { min, max }` [ms].
    #[serde(default)]
    pub periods_ms: BTreeMap<String, f64>,
}

fn dwell_s() -> f64 {
    2.0
}

/// A rule that was read.
#[derive(Debug, Clone, PartialEq)]
pub struct Rule {
    /// When it holds.
    pub when: Condition,
    /// The mode that it asks for.
    pub mode: String,
    /// Periods that it asks for, by instance name [s].
    pub periods_s: Vec<(String, f64)>,
    dwell_s: f64,
}

/// The rules in their order, and which one was obeyed last.
#[derive(Debug, Clone)]
pub struct Rules {
    rules: Vec<Rule>,
    present: Option<(usize, Time)>,
}

impl Rules {
    /// Reads the table; else says which rule is wrong and why.
    pub fn parse(table: &[RuleConfig], longest_name: usize) -> Result<Rules, String> {
        let mut rules: Vec<Rule> = Vec::new();
        for (index, row) in table.iter().enumerate() {
            let when = Condition::parse(&row.when).map_err(|why| format!("rules[{index}].when: {why}"))?;
            if !(row.dwell_s >= 0.0 && row.dwell_s.is_finite()) {
                return Err(format!("rules[{index}].dwell_s = {} must be a number, zero or greater", row.dwell_s));
            }
            if row.mode.is_empty() || row.mode.len() > longest_name {
                return Err(format!("rules[{index}].mode = \"{}\" must have 1 to {longest_name} bytes", row.mode));
            }
            if let Some(above) = rules.iter().position(|above| above.when.covers(&when)) {
                let (here, there) = (&row.when, rules[above].when.text());
                let what = if rules[above].when.covers(&when) && when.covers(&rules[above].when) {
                    if rules[above].mode == row.mode { "says again what" } else { "contradicts what" }
                } else {
                    "never matches: whenever it holds, so does what"
                };
                return Err(format!(
                    "rules[{index}] (when \"{here}\") {what} rules[{above}] says (when \"{there}\"), which comes first: \
                     put the narrower one first, or take one out"
                ));
            }
            if let Some((node, ms)) = row.periods_ms.iter().find(|(_, ms)| !(ms.is_finite() && **ms > 0.0)) {
                return Err(format!("rules[{index}].periods_ms.{node} = {ms} must be a number above 0"));
            }
            let periods_s = row.periods_ms.iter().map(|(node, ms)| (node.clone(), ms / 1e3)).collect();
            rules.push(Rule { when, mode: row.mode.clone(), periods_s, dwell_s: row.dwell_s });
        }
        Ok(Rules { rules, present: None })
    }

    /// The rules in their order.
    pub fn rules(&self) -> &[Rule] {
        &self.rules
    }

    /// The rule to obey, its index first, once one has held.
    pub fn present(&self) -> Option<(usize, &Rule)> {
        self.present.map(|(index, _)| (index, &self.rules[index]))
    }

    /// Looks at the signals; true when another rule is obeyed from now on.
    pub fn update(&mut self, now: Time, signals: &Signals) -> bool {
        let Some(first) = self.rules.iter().position(|rule| rule.when.holds(signals)) else { return false };
        let changes = match self.present {
            None => true,
            Some((present, _)) if first <= present => first < present,
            Some((present, since)) => now.since(since) >= self.rules[present].dwell_s,
        };
        match &mut self.present {
            // It still holds: its dwell time begins anew when it does not any more.
            Some((present, since)) if *present == first => *since = now,
            present if changes => *present = Some((first, now)),
            _ => {}
        }
        changes
    }
}

#[cfg(test)]
mod tests {
    use super::super::signal::Signal;
    use super::*;
    use proptest::prelude::*;

    fn rule(when: &str, mode: &str) -> RuleConfig {
        RuleConfig { when: when.into(), mode: mode.into(), dwell_s: 2.0, periods_ms: BTreeMap::new() }
    }

    fn table() -> Vec<RuleConfig> {
        vec![rule("limp >= 1", "crawl"), rule("danger > 0.6", "avoid"), rule("always", "wander")]
    }

    fn at(danger: f64, limp: f64) -> Signals {
        let mut signals = Signals::default();
        (signals[Signal::Danger], signals[Signal::Limp]) = (danger, limp);
        signals
    }

    fn mode(rules: &Rules) -> &str {
        &rules.present().unwrap().1.mode
    }

    #[test]
    fn the_first_rule_that_holds_names_the_mode() {
        let mut rules = Rules::parse(&table(), 31).unwrap();
        assert!(rules.present().is_none());
        assert!(rules.update(Time::ZERO, &at(0.2, 0.0)));
        assert_eq!(mode(&rules), "wander");
        assert!(!rules.update(Time::ZERO, &at(0.2, 0.0)), "the same again is no decision");
        assert!(rules.update(Time::ZERO, &at(0.7, 1.0)));
        assert_eq!(mode(&rules), "crawl");
    }

    #[test]
    fn up_the_table_at_once_and_down_only_after_the_dwell_time() {
        let mut rules = Rules::parse(&table(), 31).unwrap();
        rules.update(Time::ZERO, &at(0.2, 0.0));
        let seconds = Time::from_seconds;
        assert!(rules.update(seconds(0.1), &at(0.7, 0.0)));
        assert!(!rules.update(seconds(1.0), &at(0.5, 0.0)), "a signal about its bound");
        assert!(!rules.update(seconds(2.0), &at(0.7, 0.0)));
        assert!(!rules.update(seconds(3.9), &at(0.5, 0.0)), "counted from when it held last");
        assert!(rules.update(seconds(4.0), &at(0.5, 0.0)));
        assert_eq!(mode(&rules), "wander");
    }

    #[test]
    fn where_nothing_holds_the_present_mode_stays() {
        let mut rules = Rules::parse(&table()[..2], 31).unwrap();
        assert!(!rules.update(Time::ZERO, &at(0.1, 0.0)));
        assert!(rules.present().is_none());
        rules.update(Time::ZERO, &at(0.9, 0.0));
        assert!(!rules.update(Time::from_seconds(60.0), &at(0.1, 0.0)));
        assert_eq!(mode(&rules), "avoid");
    }

    #[test]
    fn rules_that_contradict_or_never_match_are_refused_with_both_named() {
        for (second, why) in [
            (rule("danger > 0.6", "wander"), "contradicts what rules[0]"),
            (rule("danger > 0.6", "avoid"), "says again what rules[0]"),
            (rule("danger > 0.7 and limp >= 1", "crawl"), "never matches"),
            (rule("danger > 1.5", "crawl"), "can never hold"),
            (rule("always", ""), "must have 1 to 31 bytes"),
            (RuleConfig { periods_ms: [("a".into(), 0.0)].into(), ..rule("always", "crawl") }, "periods_ms.a = 0"),
            (RuleConfig { dwell_s: f64::NAN, ..rule("always", "crawl") }, "dwell_s = NaN"),
        ] {
            let said = Rules::parse(&[rule("danger > 0.6", "avoid"), second], 31).unwrap_err();
            assert!(said.starts_with("rules[1]") && said.contains(why), "{said}");
        }
    }

    proptest! {
        #[test]
        fn no_mode_is_left_for_a_lower_rule_before_its_dwell_time(dangers in prop::collection::vec(0.0..1.0f64, 1..200)) {
            let mut rules = Rules::parse(&table(), 31).unwrap();
            let mut held_last = 0.0;
            for (k, danger) in dangers.into_iter().enumerate() {
                let now_s = k as f64 * 0.2;
                let before = rules.present().map(|(index, _)| index);
                rules.update(Time::from_seconds(now_s), &at(danger, 0.0));
                let after = rules.present().map(|(index, _)| index);
                if before == Some(1) && after == Some(2) {
                    prop_assert!(now_s - held_last >= 2.0 - 1e-9);
                }
                if danger > 0.6 {
                    held_last = now_s;
                }
            }
        }
    }
}
