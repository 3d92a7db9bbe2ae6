//! A task that wakes itself while it is polled is polled again at once, on the same thread.
//!
//! A connection does so with every body: what takes bytes off the wire wakes what reads them, and both are one task. The
//! runtime would put the task at the end of its line and wake another thread to take it from there: two switches of
//! context and a cold cache for nothing.

use std::future::Future;
use std::pin::{Pin, pin};
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::task::{Context, Poll, Wake, Waker};

use futures_util::task::AtomicWaker;

/// Polls without a pause after which others have their turn.
const MOST_POLLS: usize = 8;

/// Nobody polls: a wake goes to the runtime.
const AT_REST: u8 = 0;
/// A wake is left for who polls.
const POLLED: u8 = 1;
/// One was left.
const WOKEN: u8 = 2;

/// Takes the wakes of a task.
#[derive(Default)]
struct Relay {
    state: AtomicU8,
    runtime: AtomicWaker,
}

impl Wake for Relay {
    fn wake(self: Arc<Self>) {
        self.wake_by_ref();
    }

    fn wake_by_ref(self: &Arc<Self>) {
        let left = self.state.compare_exchange(POLLED, WOKEN, Ordering::AcqRel, Ordering::Acquire);
        if left == Err(AT_REST) {
            self.runtime.wake();
        }
    }
}

/// The same future, polled in place.
pub(super) async fn in_place<F: Future>(future: F) -> F::Output {
    let mut future = pin!(future);
    let relay = Arc::new(Relay::default());
    let waker = Waker::from(Arc::clone(&relay));
    std::future::poll_fn(move |context| poll(&relay, &waker, future.as_mut(), context)).await
}

fn poll<F: Future>(
    relay: &Relay,
    waker: &Waker,
    mut future: Pin<&mut F>,
    context: &mut Context<'_>,
) -> Poll<F::Output> {
    relay.runtime.register(context.waker());
    for _ in 0..MOST_POLLS {
        relay.state.store(POLLED, Ordering::Release);
        if let Poll::Ready(output) = future.as_mut().poll(&mut Context::from_waker(waker)) {
            return Poll::Ready(output);
        }
        if relay.state.compare_exchange(POLLED, AT_REST, Ordering::AcqRel, Ordering::Acquire).is_ok() {
            return Poll::Pending;
        }
    }
    // Others first, then it again.
    relay.state.store(AT_REST, Ordering::Release);
    context.waker().wake_by_ref();
    Poll::Pending
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicUsize;
    use std::time::Duration;

    /// Counts how often the runtime is woken.
    #[derive(Default)]
    struct Runtime(AtomicUsize);

    impl Wake for Runtime {
        fn wake(self: Arc<Self>) {
            self.0.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Wakes itself so many times before it is ready.
    fn restless(mut times: usize) -> impl Future<Output = &'static str> {
        std::future::poll_fn(move |context| {
            if times == 0 {
                return Poll::Ready("done");
            }
            times -= 1;
            context.waker().wake_by_ref();
            Poll::Pending
        })
    }

    /// What the first poll comes to, and how often the runtime was woken.
    fn polled_once<F: Future>(future: F) -> (Poll<F::Output>, usize) {
        let runtime = Arc::new(Runtime::default());
        let waker = Waker::from(Arc::clone(&runtime));
        let polled = pin!(in_place(future)).poll(&mut Context::from_waker(&waker));
        (polled, runtime.0.load(Ordering::Relaxed))
    }

    #[test]
    fn what_wakes_itself_is_polled_again_and_nobody_hears_of_it() {
        assert_eq!(polled_once(restless(MOST_POLLS - 1)), (Poll::Ready("done"), 0));
    }

    #[test]
    fn who_never_rests_lets_others_have_their_turn() {
        assert_eq!(polled_once(restless(MOST_POLLS)), (Poll::Pending, 1));
    }

    #[test]
    fn what_waits_for_others_wakes_nobody() {
        assert_eq!(polled_once(std::future::pending::<()>()), (Poll::Pending, 0));
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn wakes_from_outside_arrive_whenever_they_come() {
        let (sender, mut receiver) = tokio::sync::mpsc::channel(1);
        let heard = tokio::spawn(in_place(async move {
            let mut sum = 0;
            while let Some(number) = receiver.recv().await {
                sum += number;
                restless(3).await;
            }
            sum
        }));
        for number in 0..10_000_u64 {
            sender.send(number).await.unwrap();
        }
        drop(sender);
        let sum = tokio::time::timeout(Duration::from_mins(1), heard).await.unwrap().unwrap();
        assert_eq!(sum, 9999 * 10_000 / 2);
    }
}
