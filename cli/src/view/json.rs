//! The state of a run for programs: an object a second, one for each incident, one at the end.

use super::Seen;
use super::line::held;
use super::news::News;
use super::nodes::Nodes;
use super::watch::Picture;
use serde_json::{Value, json};
use supervisor::Outcome;

/// The robot now.
pub fn of_picture(picture: &Picture, nodes: &Nodes) -> Value {
    let pose = picture.pose;
    let velocity = picture.velocity();
    let contacts = picture.truth.map(|truth| truth.contacts);
    json!({
        "event": "state",
        "time_s": picture.watched_s,
        "x_m": pose.map(|pose| pose.x_m),
        "y_m": pose.map(|pose| pose.y_m),
        "heading_rad": pose.map(|pose| pose.heading_rad),
        "speed_m_s": velocity.map(|velocity| velocity.linear_x_m_s),
        "turn_rad_s": velocity.map(|velocity| velocity.angular_z_rad_s),
        "battery_v": picture.base.map(|base| base.battery_v).filter(|volts| volts.is_finite()),
        "clearance_m": picture.truth.map(|truth| truth.clearance_m),
        "contacts_caused": contacts.map(|c| c[0] + c[1]),
        "contacts_suffered": contacts.map(|c| c[2]),
        "held": held(picture),
        "nodes": nodes.rows.len(),
        "nodes_up": nodes.up(),
        "restarts": nodes.restarts(),
    })
}

/// What the supervisor told, where it matters.
pub fn of_news(news: &News) -> Option<Value> {
    match news {
        News::Incident(record) => {
            let mut value = serde_json::to_value(record).ok()?;
            value["incident"] = value["event"].take();
            value["event"] = "incident".into();
            Some(value)
        }
        News::Robot(state) => Some(json!({"event": "robot", "state": state.word()})),
        News::Note(text) => Some(json!({"event": "note", "message": text})),
        News::Started { .. } | News::Ready { .. } => None,
    }
}

/// The run as a whole.
pub fn of_end(outcome: &Outcome, seen: &Seen) -> Value {
    json!({
        "event": "end",
        "stopped_by": outcome.stopped_by.to_string(),
        "ran_s": outcome.ran_s,
        "distance_m": seen.distance_m,
        "mean_speed_m_s": seen.mean_speed_m_s,
        "least_clearance_m": Some(seen.least_clearance_m).filter(|clearance_m| clearance_m.is_finite()),
        "contacts_caused": seen.contacts.map(|c| c[0] + c[1]),
        "contacts_suffered": seen.contacts.map(|c| c[2]),
        "restarts": outcome.restarts,
        "lost": outcome.lost,
    })
}

#[cfg(test)]
mod tests {
    use super::super::nodes::tests::nodes;
    use super::*;

    #[test]
    fn what_is_not_known_is_null() {
        let value = of_picture(&Picture::default(), &nodes(&["/a/b"]));
        assert_eq!(value["battery_v"], Value::Null);
        assert_eq!(value["contacts_caused"], Value::Null);
        assert_eq!(value["nodes_up"], 1);
    }

    #[test]
    fn an_incident_keeps_its_own_word() {
        let record = supervisor::Record { event: "died".into(), ..supervisor::Record::default() };
        let value = of_news(&News::Incident(Box::new(record))).unwrap();
        assert_eq!((value["event"].as_str(), value["incident"].as_str()), (Some("incident"), Some("died")));
    }
}
