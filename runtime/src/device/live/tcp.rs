//! TCP without waiting: names, connecting, listening.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, ToSocketAddrs};
use std::os::fd::{AsFd, OwnedFd};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use rustix::io::Errno;
use rustix::net::sockopt::{
    set_socket_keepalive, set_socket_reuseaddr, set_tcp_keepcnt, set_tcp_keepidle, set_tcp_keepintvl, set_tcp_nodelay,
    set_tcp_user_timeout, socket_error,
};
use rustix::net::{
    AddressFamily, SocketFlags, SocketType, accept_with, bind, connect, getpeername, getsockname, listen, socket_with,
};

use crate::device::WhyClosed;
use crate::pump::Waker;

/// A host's addresses, now or later.
pub(super) enum Lookup {
    Known(Vec<SocketAddr>),
    Pending(Receiver<Option<Vec<SocketAddr>>>),
}

/// The addresses of `host`. Names go to a thread of their own: the C library's resolver waits, and needs a large stack.
pub(super) fn look_up(host: &str, port: u16, waker: &Waker) -> Lookup {
    if host == "localhost" {
        let both = [IpAddr::from(Ipv4Addr::LOCALHOST), IpAddr::from(Ipv6Addr::LOCALHOST)];
        return Lookup::Known(both.map(|address| SocketAddr::new(address, port)).into());
    }
    if let Ok(address) = host.parse::<IpAddr>() {
        return Lookup::Known(vec![SocketAddr::new(address, port)]);
    }
    let (sender, receiver) = channel();
    let (host, waker) = (host.to_owned(), waker.clone());
    let resolver = std::thread::Builder::new().name("resolver".into()).spawn(move || {
        let found = (host.as_str(), port).to_socket_addrs().ok().map(Iterator::collect);
        // The device may have been closed meanwhile.
        let _ = sender.send(found);
        waker.wake();
    });
    match resolver {
        Ok(_) => Lookup::Pending(receiver),
        Err(_) => Lookup::Known(Vec::new()),
    }
}

/// Begins to connect; the socket is writable when that is over.
pub(super) fn begin(address: SocketAddr) -> Result<OwnedFd, WhyClosed> {
    let socket = stream_socket(address).map_err(WhyClosed::from_errno)?;
    match connect(&socket, &address) {
        Ok(()) | Err(Errno::INPROGRESS) => Ok(socket),
        Err(error) => Err(WhyClosed::from_errno(error)),
    }
}

/// Whether `socket`, which has become writable, is connected.
pub(super) fn finish(socket: &OwnedFd) -> Result<(), WhyClosed> {
    socket_error(socket).and_then(|result| result).map_err(WhyClosed::from_errno)?;
    // A connect to a free port of this machine may by chance meet itself.
    if getsockname(socket).ok() == getpeername(socket).ok().flatten() {
        return Err(WhyClosed::Refused);
    }
    tune(socket)
}

/// Small packets at once; a peer without power is noticed after about 5 s.
fn tune(socket: impl AsFd) -> Result<(), WhyClosed> {
    let tuned = set_tcp_nodelay(&socket, true)
        .and_then(|()| set_socket_keepalive(&socket, true))
        .and_then(|()| set_tcp_keepidle(&socket, Duration::from_secs(2)))
        .and_then(|()| set_tcp_keepintvl(&socket, Duration::from_secs(1)))
        .and_then(|()| set_tcp_keepcnt(&socket, 3))
        .and_then(|()| set_tcp_user_timeout(&socket, 5_000));
    tuned.map_err(WhyClosed::from_errno)
}

/// A listening socket and the port that it has.
pub(super) fn serve(address: SocketAddr) -> Result<(OwnedFd, u16), WhyClosed> {
    let open = || -> Result<(OwnedFd, u16), Errno> {
        let socket = stream_socket(address)?;
        set_socket_reuseaddr(&socket, true)?;
        bind(&socket, &address)?;
        listen(&socket, 4)?;
        let bound = SocketAddr::try_from(getsockname(&socket)?)?;
        Ok((socket, bound.port()))
    };
    open().map_err(WhyClosed::from_errno)
}

/// The next client that waits, if one does.
pub(super) fn next_client(listener: &OwnedFd) -> Result<Option<OwnedFd>, Errno> {
    match accept_with(listener, SocketFlags::NONBLOCK | SocketFlags::CLOEXEC) {
        Ok(client) => {
            let tuned = tune(&client).is_ok();
            Ok(tuned.then_some(client))
        }
        // The client gave up while it waited, or there is none.
        Err(Errno::AGAIN | Errno::CONNABORTED | Errno::INTR) => Ok(None),
        Err(error) => Err(error),
    }
}

fn stream_socket(address: SocketAddr) -> Result<OwnedFd, Errno> {
    let family = if address.is_ipv4() { AddressFamily::INET } else { AddressFamily::INET6 };
    socket_with(family, SocketType::STREAM, SocketFlags::NONBLOCK | SocketFlags::CLOEXEC, None)
}
