//! Lock step over Zenoh: step packets received and sent in order, with rmw_zenoh's attachment.

use std::collections::HashSet;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::Arc;
use std::time::{Duration, Instant};

use zenoh::handlers::FifoChannelHandler;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::CongestionControl;
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};

const PATIENCE: Duration = Duration::from_secs(1); // after which a wait is reported
const JOINING: Duration = Duration::from_secs(120);
const GID: [u8; 16] = *b"rust_controller.";

pub struct Bus {
    session: Session,
    key_prefix: String,
    name: String,
    pub over: Arc<AtomicBool>, // true after the plant has left the run
}

/// Subscription to the step packets of a service.
pub struct Source {
    subscriber: Subscriber<FifoChannelHandler<Sample>>,
    service: String,
}

/// Publisher on one key, with sequence numbers.
pub struct Outlet<'a> {
    publisher: Publisher<'a>,
    sequence: i64,
}

impl Bus {
    pub fn open(listen: &str, key_prefix: &str, name: &str) -> Bus {
        let mut config = zenoh::Config::default();
        for (key, value) in [
            ("mode", "\"peer\"".to_string()),
            ("listen/endpoints", format!("[\"{listen}\"]")),
            ("scouting/multicast/enabled", "false".to_string()),
            ("scouting/gossip/enabled", "false".to_string()),
            ("transport/link/tx/lease", "3000".to_string()),
        ] {
            config.insert_json5(key, &value).expect(key);
        }
        let session = zenoh::open(config)
            .wait()
            .unwrap_or_else(|e| panic!("cannot listen on {listen}: {e}"));
        Bus {
            session,
            key_prefix: key_prefix.to_string(),
            name: name.to_string(),
            over: Arc::new(AtomicBool::new(false)),
        }
    }

    pub fn source(&self, service: &str) -> Source {
        let key = format!("{}/_step/{service}", self.key_prefix);
        Source {
            subscriber: self.session.declare_subscriber(key).wait().unwrap(),
            service: service.to_string(),
        }
    }

    pub fn outlet(&self, channel: &str) -> Outlet<'_> {
        let key = format!("{}/{channel}/{}", self.key_prefix, self.name);
        let publisher = self
            .session
            .declare_publisher(key)
            .congestion_control(CongestionControl::Block);
        Outlet {
            publisher: publisher.wait().unwrap(),
            sequence: 0,
        }
    }

    /// Answer queries for the run configuration, declare presence, and wait for all of `others`.
    pub fn join(&self, config: String, others: &[String]) -> LivelinessToken {
        let key = format!("{}/_config/{}", self.key_prefix, self.name);
        let reply = key.clone();
        let answer = move |query: zenoh::query::Query| {
            query.reply(reply.clone(), config.clone()).wait().ok();
        };
        self.session
            .declare_queryable(key)
            .callback(answer)
            .background()
            .wait()
            .unwrap();
        let alive = format!("{}/_alive", self.key_prefix);
        let token = self
            .session
            .liveliness()
            .declare_token(format!("{alive}/{}", self.name))
            .wait()
            .unwrap();
        let news = self
            .session
            .liveliness()
            .declare_subscriber(format!("{alive}/*"))
            .history(true)
            .wait()
            .unwrap();
        let mut missing: HashSet<String> = others
            .iter()
            .map(|name| format!("{alive}/{name}"))
            .collect();
        let deadline = Instant::now() + JOINING;
        while !missing.is_empty() {
            if let Ok(Some(sample)) = news.recv_timeout(PATIENCE) {
                if sample.kind() == SampleKind::Put {
                    missing.remove(sample.key_expr().as_str());
                }
            }
            assert!(Instant::now() < deadline, "no participant {missing:?}");
        }
        let (over, plant) = (self.over.clone(), format!("{alive}/plant"));
        let on_change = move |sample: Sample| {
            if sample.kind() == SampleKind::Delete && sample.key_expr().as_str() == plant {
                over.store(true, Ordering::Relaxed);
            }
        };
        let watch = self
            .session
            .liveliness()
            .declare_subscriber(format!("{alive}/*"))
            .callback(on_change);
        watch.background().wait().unwrap();
        token
    }

    pub fn close(self) {
        self.session.close().wait().ok();
    }
}

impl Source {
    /// Return the step packet of `time_ns`, or None after the last one.
    pub fn take(&self, time_ns: i64, bus: &Bus, waiting: &mut Outlet) -> Option<Vec<u8>> {
        loop {
            match self.subscriber.recv_timeout(PATIENCE) {
                Ok(Some(sample)) => {
                    let payload = sample.payload().to_bytes().into_owned();
                    let attachment = sample.attachment().expect("an attachment").to_bytes();
                    let stamp = i64::from_le_bytes(attachment[8..16].try_into().unwrap());
                    if payload.is_empty() {
                        return None;
                    }
                    assert_eq!(
                        stamp, time_ns,
                        "{}: not the step packet that is due",
                        self.service
                    );
                    return Some(payload);
                }
                _ if bus.over.load(Ordering::Relaxed) => return None,
                _ => waiting.put(
                    format!("the step packet of {time_ns} ns from {}", self.service).into_bytes(),
                    0,
                ),
            }
        }
    }
}

impl Outlet<'_> {
    pub fn put(&mut self, payload: Vec<u8>, time_ns: i64) {
        self.sequence += 1;
        let mut attachment = Vec::with_capacity(33);
        attachment.extend(self.sequence.to_le_bytes());
        attachment.extend(time_ns.to_le_bytes());
        attachment.push(16);
        attachment.extend(GID);
        self.publisher
            .put(payload)
            .attachment(attachment)
            .wait()
            .expect("put");
    }
}
