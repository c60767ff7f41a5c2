//! How many connections there may be, in all and of one address, and which one goes where another one comes.
//!
//! A connection is idle while no request of it is being answered. Where all places are taken, the connection that has
//! been idle longest is asked to leave, so that no client keeps others out by holding connections it does not use.

use std::collections::HashMap;
use std::net::{IpAddr, Ipv6Addr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::Notify;
use tokio_util::sync::CancellationToken;

/// How many connections are served at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConnectionLimits {
    /// In all.
    pub total: usize,
    /// Of one address. An IPv6 network of 64 bits is one address: its holder has all of them.
    pub per_address: usize,
}

/// The connections of a service.
pub struct Connections {
    limits: ConnectionLimits,
    table: Mutex<Table>,
    /// Told when a place becomes free or a connection idle.
    changed: Notify,
}

#[derive(Default)]
struct Table {
    open: HashMap<u64, Open>,
    /// Counts connections and the moments they become idle.
    clock: u64,
}

struct Open {
    address: IpAddr,
    state: State,
    leave: CancellationToken,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// Since this reading of the clock.
    Idle(u64),
    Busy,
    /// Asked to leave; its place is given away already.
    Leaving,
}

/// The place of a connection, which is free again when this is dropped.
pub struct Place {
    connections: Arc<Connections>,
    id: u64,
    leave: CancellationToken,
}

/// A request of a connection is being answered until this is dropped.
pub struct Busy(Arc<Place>);

impl Connections {
    /// None yet.
    pub fn new(limits: ConnectionLimits) -> Self {
        let total = limits.total.max(1);
        Self {
            limits: ConnectionLimits {
                total,
                per_address: limits.per_address.clamp(1, total),
            },
            table: Mutex::default(),
            changed: Notify::new(),
        }
    }

    /// Connections that have a place.
    pub fn len(&self) -> usize {
        self.table().staying().count()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Gives a new connection of an address a place: a free one, or that of the connection that is idle longest. Waits
    /// where all are busy. `None` where all places of the address are busy.
    pub async fn admit(self: &Arc<Self>, address: IpAddr) -> Option<Place> {
        let address = network(address);
        loop {
            let changed = self.changed.notified();
            tokio::pin!(changed);
            changed.as_mut().enable();
            {
                let mut table = self.table();
                let of_address = table.staying().filter(|open| open.address == address).count();
                if of_address >= self.limits.per_address && !table.dismiss_oldest(Some(address)) {
                    return None;
                }
                if table.staying().count() < self.limits.total || table.dismiss_oldest(None) {
                    return Some(self.place(&mut table, address));
                }
            }
            changed.await;
        }
    }

    /// Asks the connection that is idle longest to leave.
    pub fn dismiss_oldest(&self) {
        self.table().dismiss_oldest(None);
    }

    fn place(self: &Arc<Self>, table: &mut Table, address: IpAddr) -> Place {
        let id = table.tick();
        let leave = CancellationToken::new();
        let open = Open {
            address,
            state: State::Idle(id),
            leave: leave.clone(),
        };
        table.open.insert(id, open);
        Place {
            connections: Arc::clone(self),
            id,
            leave,
        }
    }

    fn table(&self) -> MutexGuard<'_, Table> {
        // Every change is one assignment or one insertion.
        self.table.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Table {
    fn tick(&mut self) -> u64 {
        self.clock += 1;
        self.clock
    }

    fn staying(&self) -> impl Iterator<Item = &Open> {
        self.open.values().filter(|open| open.state != State::Leaving)
    }

    /// Asks the connection that is idle longest to leave, of all or of an address. Says whether there was one.
    fn dismiss_oldest(&mut self, address: Option<IpAddr>) -> bool {
        let candidates = self.open.values_mut().filter_map(|open| match open.state {
            State::Idle(since) if address.is_none_or(|address| open.address == address) => {
                Some((since, open))
            }
            _ => None,
        });
        let Some((_, oldest)) = candidates.min_by_key(|(since, _)| *since) else {
            return false;
        };
        oldest.state = State::Leaving;
        oldest.leave.cancel();
        true
    }
}

impl Place {
    /// Resolves when the connection is asked to leave.
    pub async fn asked_to_leave(&self) {
        self.leave.cancelled().await;
    }

    /// A request has arrived.
    pub fn begin(self: &Arc<Self>) -> Busy {
        self.set(|_| State::Busy);
        Busy(Arc::clone(self))
    }

    /// Whether a request is being answered.
    pub fn is_busy(&self) -> bool {
        let table = self.connections.table();
        table
            .open
            .get(&self.id)
            .is_some_and(|open| open.state == State::Busy)
    }

    fn set(&self, state: impl FnOnce(u64) -> State) {
        let mut table = self.connections.table();
        let now = table.tick();
        if let Some(open) = table.open.get_mut(&self.id) {
            open.state = state(now);
        }
    }
}

impl Drop for Busy {
    fn drop(&mut self) {
        // One that was asked to leave and had a request on its way stays on the way out.
        let leaving = self.0.leave.is_cancelled();
        self.0
            .set(|now| if leaving { State::Leaving } else { State::Idle(now) });
        self.0.connections.changed.notify_waiters();
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.connections.table().open.remove(&self.id);
        self.connections.changed.notify_waiters();
    }
}

/// The part of an address that one client has to itself.
fn network(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(ip) => {
            let [a, b, c, d, ..] = ip.segments();
            Ipv6Addr::new(a, b, c, d, 0, 0, 0, 0).into()
        }
        ip => ip,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn connections(total: usize, per_address: usize) -> Arc<Connections> {
        Arc::new(Connections::new(ConnectionLimits { total, per_address }))
    }

    fn ip(text: &str) -> IpAddr {
        text.parse().unwrap()
    }

    #[tokio::test]
    async fn the_connection_that_is_idle_longest_goes_first() {
        let connections = connections(3, 3);
        let one = Arc::new(connections.admit(ip("10.0.0.1")).await.unwrap());
        let two = Arc::new(connections.admit(ip("10.0.0.1")).await.unwrap());
        let three = Arc::new(connections.admit(ip("10.0.0.2")).await.unwrap());
        drop(one.begin());
        let busy = two.begin();
        let four = connections.admit(ip("10.0.0.3")).await.unwrap();
        assert!(three.leave.is_cancelled() && !one.leave.is_cancelled() && !two.leave.is_cancelled());
        let five = connections.admit(ip("10.0.0.3")).await.unwrap();
        assert!(one.leave.is_cancelled() && !two.leave.is_cancelled());
        assert_eq!(connections.len(), 3);
        drop((busy, four, five));
    }

    #[tokio::test]
    async fn an_address_has_its_own_limit_and_takes_no_place_of_others() {
        let connections = connections(4, 2);
        let other = connections.admit(ip("10.0.0.9")).await.unwrap();
        let mut held = Vec::new();
        for last in 0..20 {
            // One client has a whole network of IPv6.
            let address = ip(&format!("2001:db8::{last}"));
            held.push(Arc::new(connections.admit(address).await.unwrap()));
        }
        assert!(!other.leave.is_cancelled());
        assert_eq!(connections.len(), 3);
        let busy: Vec<Busy> = held.iter().skip(18).map(Place::begin).collect();
        assert!(connections.admit(ip("2001:db8::ffff")).await.is_none());
        assert!(connections.admit(ip("::ffff:10.0.0.9")).await.is_some());
        drop(busy);
    }

    #[tokio::test]
    async fn where_all_are_busy_a_new_one_waits() {
        let connections = connections(1, 1);
        let place = Arc::new(connections.admit(ip("10.0.0.1")).await.unwrap());
        let busy = place.begin();
        let waiting = connections.admit(ip("10.0.0.2"));
        tokio::pin!(waiting);
        assert!(
            tokio::time::timeout(Duration::from_millis(30), &mut waiting)
                .await
                .is_err()
        );
        drop(busy);
        let admitted = tokio::time::timeout(Duration::from_secs(5), waiting)
            .await
            .unwrap();
        assert!(admitted.is_some() && place.leave.is_cancelled());
    }
}
