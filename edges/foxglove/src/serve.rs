//! The server: advertises the robot's topics, and hands every new sample to those who have subscribed.

use crate::Args;
use crate::outlet::{ServeError, Viewers};
use foxglove::websocket::{ChannelView, Client, ServerListener};
use foxglove::{ChannelId, Context, SinkId, WebSocketServer};
use recorder::feed::Feed;
use recorder::follow::{Options, follow};
use runtime::clock;
use serde_json::json;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Subscriptions that have not been answered with the newest sample yet.
#[derive(Default)]
struct Subscriptions(Mutex<Vec<(ChannelId, Option<SinkId>)>>);

impl Subscriptions {
    fn take(&self) -> Vec<(ChannelId, Option<SinkId>)> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl ServerListener for Subscriptions {
    fn on_subscribe(&self, client: Client, channel: ChannelView<'_>) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push((channel.id(), client.sink_id()));
    }
}

/// Serves until a signal ends it or the robot is gone.
pub fn serve(args: &Args) -> Result<(), ServeError> {
    let stop = recorder::live::stop_by_signals().map_err(|e| ServeError::Server(format!("no signal handler: {e}")))?;
    let context = Context::new();
    let subscriptions = Arc::new(Subscriptions::default());
    let server = WebSocketServer::new()
        .name(format!("sinew: {}", args.robot))
        .bind(args.bind.to_string(), args.port)
        .server_info(HashMap::from([("robot".to_owned(), args.robot.clone())]))
        .session_id(format!("{}-{}", args.robot, clock::now().nanos()))
        .listener(subscriptions.clone())
        .context(&context)
        .start_blocking()
        .map_err(|e| ServeError::Server(cannot_listen(args, &e)))?;
    let offset_ns = ((clock::wall_seconds() * 1e9) as u64).saturating_sub(clock::now().nanos());
    let mut feed = Feed::new(Viewers::new(context), offset_ns);
    let options = Options { root: args.folder.clone(), robot: args.robot.clone(), paths: args.paths.clone() };
    let mut told = false;
    let followed = follow(&options, &mut feed, &stop, |taps, feed| {
        // Who subscribes sees what there is at once, and need not wait for the next sample of a slow channel.
        for (id, viewer) in subscriptions.take() {
            feed.outlet().only = Some((id, viewer));
            let topic = feed.outlet().topic_of(id).unwrap_or_default();
            let path = topic.strip_prefix("/ros").unwrap_or(topic);
            let path = path.strip_suffix("/compressed").unwrap_or(path).to_owned();
            taps.repeat(&path, feed)?;
            feed.outlet().only = None;
        }
        if !std::mem::replace(&mut told, true) {
            announce(args, server.port());
        }
        Ok(())
    });
    server.stop();
    let followed = followed?;
    match args.json {
        true => println!("{}", json!({ "event": "over", "samples": followed.samples, "lost": followed.lost })),
        false => eprintln!("robot \"{}\": {} samples read, {} lost", args.robot, followed.samples, followed.lost),
    }
    Ok(())
}

fn announce(args: &Args, port: u16) {
    let url = format!("ws://{}", std::net::SocketAddr::new(args.bind, port));
    if args.json {
        println!("{}", json!({ "event": "serving", "robot": args.robot, "url": url, "port": port }));
        return;
    }
    eprintln!("robot \"{}\" is served at {url}; Ctrl-C ends it", args.robot);
    eprintln!("In Lichtblick or Foxglove: Open connection, Foxglove WebSocket, {url}");
    if !args.bind.is_loopback() {
        eprintln!("warning: whoever reaches {} can watch this robot; nobody can move it from there", args.bind);
    }
}

fn cannot_listen(args: &Args, error: &foxglove::FoxgloveError) -> String {
    format!("cannot listen on {} port {}: {error}; choose another with --port, 0 for any", args.bind, args.port)
}
