//! What every driver's link has in common: the port that comes and goes, answers that do not come, line rates to try,
//! and when to open the port anew. Pure: the session tells what happens, the node does what is demanded.

use crate::port::{Demand, Port};
use messages::Link;

/// Misses after which the port is opened anew, unless there are more line rates to try before.
const MISSES_PER_REOPEN: u32 = 5;
/// Misses after which the next line rate is tried.
const MISSES_PER_BAUD: u32 = 2;

/// How a session stands with its port; see the module's text.
#[derive(Debug, Clone)]
pub struct Contact {
    port: Port,
    /// State of the link, and why there are no data.
    pub link: Link,
    demand: Option<Demand>,
    misses: u32,
    /// Rates to try in turn when nothing answers, the port's own left out.
    hunt_bauds: Vec<u32>,
    next_baud: usize,
    /// The line's rate as the port opens it, and as it is set now.
    own_baud: Option<u32>,
    baud: Option<u32>,
    /// The port was open and is being opened anew at our own wish.
    is_reopening: bool,
}

impl Contact {
    /// With a closed port whose line has this rate, if any, and rates to try where nothing answers.
    pub fn new(own_baud: Option<u32>, hunt_bauds: Vec<u32>) -> Contact {
        Contact {
            port: Port::Closed,
            link: Link::Connecting,
            demand: None,
            misses: 0,
            hunt_bauds,
            next_baud: 0,
            own_baud,
            baud: own_baud,
            is_reopening: false,
        }
    }

    /// What the port was last said to do.
    pub fn port(&self) -> Port {
        self.port
    }

    /// The line's rate as it is set now; `None` where it has none [baud].
    pub fn baud(&self) -> Option<u32> {
        self.baud
    }

    /// The port's state has changed. True where it has just been opened: the session begins.
    pub fn moved(&mut self, port: Port) -> bool {
        let before = std::mem::replace(&mut self.port, port);
        if let Port::Open(_) = port {
            // A new link begins at the port's own rate.
            (self.misses, self.next_baud, self.baud) = (0, 0, self.own_baud);
            if !std::mem::take(&mut self.is_reopening) {
                self.link = Link::Connecting;
            }
            return true;
        }
        self.link = match (before, port) {
            // We closed it ourselves: what was wrong still is.
            (Port::Open(_), _) if self.is_reopening => self.link,
            (Port::Open(_), _) => Link::Lost,
            _ if self.link == Link::Lost => Link::Lost,
            (_, Port::Closed) => {
                self.is_reopening = false;
                Link::NoPort
            }
            _ if self.is_reopening => self.link,
            // Another try at a port that could not be opened: until it is open, it could not.
            (Port::Closed, Port::Opening) if self.link == Link::NoPort => Link::NoPort,
            _ => Link::Connecting,
        };
        false
    }

    /// Data flow. Whether they did not before.
    pub fn up(&mut self) -> bool {
        self.misses = 0;
        std::mem::replace(&mut self.link, Link::Up) != Link::Up
    }

    /// An answer did not come. `foreign`: something came all the same, which no such device would say.
    pub fn miss(&mut self, foreign: bool) {
        self.misses = self.misses.saturating_add(1);
        self.link = if foreign { Link::Foreign } else { Link::Silent };
        let rates = self.hunt_bauds.len();
        if self.misses.is_multiple_of(MISSES_PER_REOPEN.max((rates as u32 + 1) * MISSES_PER_BAUD)) {
            self.is_reopening = true;
            self.demand = Some(Demand::Reopen);
        } else if self.misses.is_multiple_of(MISSES_PER_BAUD) && rates > 0 {
            self.next_baud = (self.next_baud + 1) % rates;
            self.switch(self.hunt_bauds[self.next_baud]);
        }
    }

    /// The line goes on at this rate.
    pub fn switch(&mut self, baud: u32) {
        self.baud = Some(baud);
        self.demand = Some(Demand::Baud(baud));
    }

    /// What the port should do.
    pub fn take_demand(&mut self) -> Option<Demand> {
        self.demand.take()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_says_why_it_is_down_until_something_better_is_known() {
        let mut contact = Contact::new(None, Vec::new());
        let mut seen = Vec::new();
        for port in [Port::Opening, Port::Closed, Port::Opening, Port::Open(1), Port::Closed, Port::Opening] {
            contact.moved(port);
            seen.push(contact.link);
        }
        use Link::{Connecting, Lost, NoPort};
        assert_eq!(seen, [Connecting, NoPort, NoPort, Connecting, Lost, Lost]);
    }

    #[test]
    fn every_rate_is_tried_twice_and_then_the_port_is_opened_anew() {
        let mut contact = Contact::new(Some(9600), vec![9600, 38_400, 19_200]);
        assert!(contact.moved(Port::Open(1)));
        let mut demands = Vec::new();
        for _ in 0..8 {
            contact.miss(false);
            demands.extend(contact.take_demand());
        }
        assert_eq!(demands, [Demand::Baud(38_400), Demand::Baud(19_200), Demand::Baud(9600), Demand::Reopen]);
        // Closed by ourselves: what was wrong still is.
        contact.moved(Port::Closed);
        assert_eq!(contact.link, Link::Silent);
        contact.moved(Port::Open(2));
        assert_eq!((contact.link, contact.baud()), (Link::Silent, Some(9600)));
    }
}
