//! iceoryx2: a publish-subscribe service each way for the payloads, an event service each way for waking.

use super::line::{End, Line, Proof, proof};
use crate::exit::Failure;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::*;
use std::path::Path as FilePath;

/// Its folder below the line's.
const ROOT: &str = "i";

/// One end.
pub struct Services {
    publisher: Publisher<ipc::Service, [u8], ()>,
    subscriber: Subscriber<ipc::Service, [u8], ()>,
    notifier: Notifier<ipc::Service>,
    listener: Listener<ipc::Service>,
    payload: Vec<u8>,
    /// Everything above belongs to it.
    _node: Node<ipc::Service>,
}

/// Begin of the names of its shared memory, which lies outside of its folder; `folder` is that of the line or of the
/// run. Short, because it becomes part of the names of sockets, of which the kernel allows 107 bytes.
fn prefix(folder: &FilePath) -> String {
    let names = folder.components().map(|part| part.as_os_str().to_string_lossy());
    let run = names.filter(|name| name.starts_with('.')).next_back().unwrap_or_default();
    format!("b{}_", run.trim_start_matches(|c: char| !c.is_ascii_digit()))
}

/// Removes what the answering processes, which are killed, left in shared memory.
pub fn clean(folder: &FilePath) {
    let prefix = prefix(folder);
    for entry in std::fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().starts_with(&prefix) {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// Makes the folder of its files.
pub fn prepare(folder: &FilePath) -> Result<(), Failure> {
    Ok(std::fs::create_dir_all(folder.join(ROOT))?)
}

fn text(error: impl std::fmt::Debug) -> Failure {
    Failure::from(format!("iceoryx2: {error:?}"))
}

impl Services {
    /// Opens one end; whoever comes first makes the services.
    pub fn open(folder: &FilePath, size: usize, end: End) -> Result<Services, Failure> {
        set_log_level(LogLevel::Error);
        let root = folder.join(ROOT).display().to_string();
        let mut config = Config::default();
        config.global.set_root_path(&Path::new(root.as_bytes()).map_err(text)?);
        config.global.prefix = FileName::new(prefix(folder).as_bytes()).map_err(text)?;
        let node = NodeBuilder::new().config(&config).create::<ipc::Service>().map_err(text)?;
        let (written, read) = match end {
            End::Asking => ("there", "back"),
            End::Answering => ("back", "there"),
        };
        let payloads = |name: &str| {
            let service = node.service_builder(&name.try_into().map_err(text)?);
            let service = service.publish_subscribe::<[u8]>().max_publishers(1).max_subscribers(2);
            service.subscriber_max_buffer_size(8).history_size(0).open_or_create().map_err(text)
        };
        let events = |name: &str| {
            let service = node.service_builder(&name.try_into().map_err(text)?);
            service.event().open_or_create().map_err(text)
        };
        let (outgoing, incoming) = (payloads(written)?, payloads(read)?);
        let (wakes, woken) = (events(written)?, events(read)?);
        Ok(Services {
            publisher: outgoing.publisher_builder().initial_max_slice_len(size).create().map_err(text)?,
            subscriber: incoming.subscriber_builder().create().map_err(text)?,
            notifier: wakes.notifier_builder().create().map_err(text)?,
            listener: woken.listener_builder().create().map_err(text)?,
            payload: vec![0; size],
            _node: node,
        })
    }
}

impl Line for Services {
    fn send(&mut self, payload: &[u8]) -> Result<(), Failure> {
        let sample = self.publisher.loan_slice_uninit(payload.len()).map_err(text)?;
        sample.write_from_slice(payload).send().map_err(text)?;
        self.notifier.notify().map_err(text)?;
        Ok(())
    }

    fn receive(&mut self) -> Result<Proof, Failure> {
        loop {
            if let Some(sample) = self.subscriber.receive().map_err(text)? {
                self.payload.copy_from_slice(sample.payload());
                return Ok(proof(&self.payload));
            }
            self.listener.blocking_wait(|_| {}).map_err(text)?;
        }
    }
}
