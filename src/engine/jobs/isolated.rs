//! A computation in a process of its own, so that what kills it is told apart from what killed the service.
//!
//! A start that ends with its process is charged to the job, whoever ended the process: the job, a neighbour, an operator,
//! the power. So a charge alone says nothing of the job. At the last attempt its computation has a process to itself, and
//! only how *that* ends, while the service lives on, says whether the job is to blame. However often the service itself is
//! killed meanwhile, the job is taken up again.

use std::ffi::OsString;
use std::io::{Read, Write};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use bytes::Bytes;
use std::sync::Arc;

use super::running::Running;
use super::{MOST_ATTEMPTS, fault, work};
use crate::engine::exec::{Left, Slot, guarded};
use crate::engine::read::Ready;
use crate::engine::{Engine, Error, Inner, Stored, compute, outcome};
use crate::registry::Registry;

/// What comes before the answer in the output of the process; whatever else a program prints stands before it.
const ANSWER: &[u8] = b"\x01precut answer\n";
/// The same before the reason why there is none.
const REASON: &[u8] = b"\x01precut reason\n";
/// How often it is looked whether the process has ended, or nobody wants it any more.
const LOOK: Duration = Duration::from_millis(10);
/// So often a process of its own may be killed outright, as the system does when memory runs out, before that counts as the
/// job's doing.
const MOST_KILLS: u32 = 3;

/// How a process for one computation is started: the program itself, told to compute what it reads.
#[derive(Debug, Clone)]
pub struct Isolation {
    /// The program.
    pub program: PathBuf,
    /// Its arguments.
    pub arguments: Vec<OsString>,
    /// Variables of its environment, besides those of this process.
    pub environment: Vec<(OsString, OsString)>,
}

/// One answer of one calculator, computed by a process of its own.
pub(super) struct Isolated {
    pub(super) ready: Ready,
    pub(super) isolation: Isolation,
}

impl Isolated {
    pub(super) async fn run(
        self,
        engine: &Arc<Inner>,
        running: &Arc<Running>,
        slot: Slot,
    ) -> Result<Arc<Stored>, Error> {
        let Self { ready, isolation } = self;
        if let Some(kept) = engine.look_up(&ready.key).await {
            return outcome(kept);
        }
        let (engine, running) = (Arc::clone(engine), Arc::clone(running));
        let computed = move |left: &Left<'_>| {
            let begun = Instant::now();
            let computed = compute_apart(&ready, &isolation, &|| running.is_cancelled() || left());
            engine.keep(&ready, computed, begun.elapsed())
        };
        slot.run(computed).await
    }
}

/// Computes an answer in a process of its own.
pub(crate) fn compute_apart(
    ready: &Ready,
    isolation: &Isolation,
    given_up: &dyn Fn() -> bool,
) -> Result<Stored, Error> {
    let body = answered(ready, isolation, given_up)?;
    Ok(Stored { key: ready.key, body, input: ready.canonical.clone(), entry: Arc::clone(&ready.entry) })
}

fn answered(ready: &Ready, isolation: &Isolation, given_up: &dyn Fn() -> bool) -> Result<Bytes, Error> {
    let mut kills = 0;
    loop {
        let failed = |error: std::io::Error| Error::internal(format!("a process for a job: {error}"));
        match once(ready, isolation, given_up).map_err(failed)? {
            Ended::Answer(body) => return Ok(body),
            Ended::Reason(reason) => return Err(fault::read(&reason)),
            Ended::GivenUp => return Err(Error::Cancelled),
            Ended::Stopped => return Err(Error::ShuttingDown),
            Ended::Killed if kills + 1 < MOST_KILLS => kills += 1,
            Ended::Killed | Ended::Crashed => return Err(Error::CrashedRepeatedly { attempts: MOST_ATTEMPTS }),
        }
    }
}

/// How the process ended.
enum Ended {
    Answer(Bytes),
    Reason(String),
    GivenUp,
    /// Somebody asked it to stop, as is done with all processes of a machine that goes down.
    Stopped,
    /// It was killed outright.
    Killed,
    Crashed,
}

fn once(ready: &Ready, isolation: &Isolation, given_up: &dyn Fn() -> bool) -> std::io::Result<Ended> {
    let mut child = Command::new(&isolation.program)
        .args(&isolation.arguments)
        .envs(isolation.environment.iter().map(|(name, value)| (name, value)))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::inherit())
        .spawn()?;
    let (input, output) = (child.stdin.take(), child.stdout.take());
    let question = [ready.entry.meta().id.as_bytes(), b"\n", &ready.canonical].concat();
    thread::scope(|scope| {
        let (told, done) = std::sync::mpsc::channel::<()>();
        scope.spawn(move || {
            let Some(mut input) = input else { return };
            let length = u64::try_from(question.len()).unwrap_or(u64::MAX).to_le_bytes();
            // A process that has ended reads nothing. One that lives ends when this pipe does.
            let _ = input.write_all(&length).and_then(|()| input.write_all(&question)).and_then(|()| input.flush());
            let _ = done.recv();
        });
        let reader = scope.spawn(move || {
            let mut said = Vec::new();
            output.map_or(Ok(0), |mut output| output.read_to_end(&mut said)).map(|_| said)
        });
        let status = wait(&mut child, given_up);
        drop(told);
        let said = reader.join().unwrap_or_else(|_| Ok(Vec::new()))?;
        Ok(status?.map_or(Ended::GivenUp, |status| ended(status, &said)))
    })
}

/// Waits for the end of the process; nothing if it was given up.
fn wait(child: &mut Child, given_up: &dyn Fn() -> bool) -> std::io::Result<Option<ExitStatus>> {
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if given_up() {
            child.kill()?;
            child.wait()?;
            return Ok(None);
        }
        thread::sleep(LOOK);
    }
}

fn ended(status: ExitStatus, said: &[u8]) -> Ended {
    let after = |mark: &[u8]| {
        let place = said.windows(mark.len()).position(|bytes| bytes == mark)?;
        Some(Bytes::copy_from_slice(&said[place + mark.len()..]))
    };
    if status.success() {
        if let Some(body) = after(ANSWER) {
            return Ended::Answer(body);
        }
        if let Some(reason) = after(REASON) {
            return Ended::Reason(String::from_utf8_lossy(&reason).into_owned());
        }
    }
    match signal(status) {
        Some(1 | 2 | 15) => Ended::Stopped,
        Some(9) => Ended::Killed,
        _ => Ended::Crashed,
    }
}

#[cfg(unix)]
fn signal(status: ExitStatus) -> Option<i32> {
    std::os::unix::process::ExitStatusExt::signal(&status)
}

#[cfg(not(unix))]
fn signal(_status: ExitStatus) -> Option<i32> {
    None
}

impl Engine {
    /// Computes what stands in `input` as `Isolated` writes it, and writes what it came to. Ends the process when the
    /// input does: whoever wanted the answer is gone.
    pub fn compute_alone(
        registry: &Registry,
        mut input: impl Read + Send + 'static,
        output: &mut impl Write,
    ) -> std::io::Result<()> {
        let mut length = [0; 8];
        input.read_exact(&mut length)?;
        let mut question = Vec::new();
        input.by_ref().take(u64::from_le_bytes(length)).read_to_end(&mut question)?;
        thread::spawn(move || {
            let _ = input.read(&mut [0]);
            std::process::exit(1);
        });
        let line = question.iter().position(|byte| *byte == b'\n').unwrap_or(question.len());
        let calculator = String::from_utf8_lossy(&question[..line]).into_owned();
        let job = question.get(line + 1..).unwrap_or_default();
        let stored = registry
            .entry(&calculator)
            .ok_or_else(|| Error::unknown(registry, &calculator))
            .and_then(|entry| guarded(|| compute(&work::ready(entry, job)?, &precut_calc::calculator::Unwatched)));
        match stored {
            Ok(stored) => output.write_all(ANSWER).and_then(|()| output.write_all(&stored.body))?,
            Err(error) => {
                output.write_all(REASON).and_then(|()| output.write_all(fault::written(&error).as_bytes()))?;
            }
        }
        output.flush()
    }
}
