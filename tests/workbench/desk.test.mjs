// The desk of a calculator's page, driven without a browser: an answer may be taken away only while it is that of what is
// typed, one request is in flight at a time, and the last thing typed is what is asked for in the end.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { Desk } from '../../ui/app/desk.js';
import { Refused, Unreachable } from '../../ui/app/api.js';
import { cell } from '../../ui/app/lib.js';

const settle = async () => {
  for (let turn = 0; turn < 20; turn += 1) await null;
};

/** A service that answers when it is told to. */
function service({ followed = {} } = {}) {
  const own = {
    asked: [],
    most: 0,
    inFlight: 0,
    cancelled: [],
    solve: (_id, job, { signal }) =>
      new Promise((resolve, reject) => {
        own.inFlight += 1;
        own.most = Math.max(own.most, own.inFlight);
        let isOver = false;
        const over = () => {
          own.inFlight -= isOver ? 0 : 1;
          isOver = true;
        };
        signal.addEventListener('abort', () => {
          over();
          reject(new DOMException('', 'AbortError'));
        });
        own.asked.push({
          job,
          signal,
          answer: () => {
            over();
            resolve({ answer: { key: `b3:${JSON.stringify(job)}`, result: job }, figures: [] });
          },
          accept: run => {
            over();
            resolve({ job: { id: run, state: 'queued' } });
          },
          refuse: () => {
            over();
            reject(new Refused(422, { title: 'no', status: 422 }));
          },
          lose: () => {
            over();
            reject(new Unreachable('away'));
          },
        });
      }),
    patient: question => question(),
    shown: async key => ({ answer: { key, result: JSON.parse(key.slice(3)) }, figures: [] }),
    calculator: async () => ({ id: 'toy', examples: [{ id: 'first' }], jobs: { first: { d: 1 } }, input_schema: {} }),
    jobOf: async key => ({ job: JSON.parse(key.slice(3)) }),
    cancel: run => {
      own.cancelled.push(run);
      return Promise.resolve();
    },
    follow: (run, handlers) => {
      followed[run] = handlers;
      return () => {
        delete followed[run];
      };
    },
    whenBack: () => null,
  };
  return own;
}

async function opened(options) {
  const far = service(options);
  const unread = cell(new Set());
  const pauses = [];
  const clock = { time: 0, now: () => clock.time, pause: () => new Promise(go => pauses.push(go)) };
  const desk = new Desk({ id: 'toy', service: far, unread, clock, address: { push: () => {}, replace: () => {} } });
  desk.pushLater = Object.assign(() => {}, { cancel: () => {} });
  await desk.describe();
  desk.open(new URLSearchParams());
  await settle();
  return { desk, far, unread, pauses, clock };
}
const job = d => ({ d });
const last = far => far.asked.at(-1);

test('an answer is theirs once it is there, and not from the first letter on that changes them', async () => {
  const { desk, far } = await opened();
  assert.equal(desk.standing(), 'none');
  last(far).answer();
  await settle();
  assert.equal(desk.standing(), 'current');
  const { key } = desk.state.answer;
  assert.equal(desk.owns(key), true);
  desk.change(job(2), 'typing');
  assert.equal(desk.standing(), 'computing');
  assert.equal(desk.owns(key), false);
  last(far).answer();
  await settle();
  assert.deepEqual([desk.standing(), desk.owns(key), desk.owns('b3:{"d":2}')], ['current', false, true]);
});

test('what cannot be read, is refused, or waits is said, each by its name', async () => {
  const { desk, far, unread, pauses, clock } = await opened();
  last(far).answer();
  await settle();
  unread.set(new Set(['field-d']));
  assert.equal(desk.standing(), 'unread');
  unread.set(new Set());
  assert.equal(desk.standing(), 'current');
  desk.change(job(-1), 'typing');
  last(far).refuse();
  await settle();
  // Half a number may be none: it is said after a pause, and until then nothing is theirs.
  assert.deepEqual([desk.standing(), desk.state.problem], ['computing', null]);
  pauses.splice(0).forEach(go => go());
  await settle();
  assert.equal(desk.standing(), 'wrong');
  desk.change(job(3), 'run');
  clock.time += 60_000;
  last(far).answer();
  await settle();
  assert.equal(desk.standing(), 'current');
  // Answers that take long are asked for, not followed.
  const before = far.asked.length;
  desk.change(job(4), 'typing');
  assert.deepEqual([desk.standing(), far.asked.length], ['changed', before]);
});

test('a refusal of what is no longer typed is not said', async () => {
  const { desk, far, pauses } = await opened();
  last(far).answer();
  await settle();
  desk.change(job(0), 'typing');
  last(far).refuse();
  await settle();
  desk.change(job(0.7), 'typing');
  pauses.splice(0).forEach(go => go());
  last(far).answer();
  await settle();
  assert.deepEqual([desk.standing(), desk.state.problem], ['current', null]);
});

test('while one types one request is in flight, and the last job typed is the one that is answered', async () => {
  const { desk, far } = await opened();
  last(far).answer();
  await settle();
  far.most = 0;
  for (let d = 2; d < 12; d += 1) desk.change(job(d), 'typing');
  assert.equal(far.asked.length, 2);
  last(far).answer();
  await settle();
  // The picture follows: what came in between is shown, and is not theirs.
  assert.deepEqual([desk.state.answer.job, desk.standing()], [job(2), 'computing']);
  assert.deepEqual([far.asked.length, last(far).job], [3, job(11)]);
  last(far).answer();
  await settle();
  assert.deepEqual([desk.state.answer.job, desk.standing(), far.most], [job(11), 'current', 1]);
});

test('a job of an older state is cancelled, and what was typed after it is asked for in its place', async () => {
  const { desk, far } = await opened();
  last(far).answer();
  await settle();
  desk.change(job(2), 'typing');
  desk.change(job(3), 'typing');
  last(far).accept('run-2');
  await settle();
  assert.deepEqual([far.cancelled, last(far).job], [['run-2'], job(3)]);
});

test('a job is theirs when it is done, and not when they changed meanwhile', async () => {
  const followed = {};
  const { desk, far } = await opened({ followed });
  last(far).accept('run-1');
  await settle();
  assert.equal(desk.state.running.id, 'run-1');
  followed['run-1'].onDone({ id: 'run-1', state: 'succeeded', key: 'b3:{"d":1}' });
  await settle();
  assert.deepEqual([desk.standing(), desk.state.running], ['current', null]);
  desk.change(job(5), 'run');
  last(far).accept('run-5');
  await settle();
  desk.change(job(6), 'typing');
  followed['run-5'].onDone({ id: 'run-5', state: 'succeeded', key: 'b3:{"d":5}' });
  await settle();
  assert.deepEqual([desk.state.answer.job, desk.standing()], [job(5), 'changed']);
});

test('a lost service is asked again, for the last thing typed', async () => {
  const { desk, far, pauses } = await opened();
  last(far).answer();
  await settle();
  desk.change(job(2), 'typing');
  desk.change(job(3), 'typing');
  last(far).lose();
  await settle();
  assert.equal(desk.standing(), 'wrong');
  pauses.splice(0).forEach(go => go());
  await settle();
  assert.deepEqual(last(far).job, job(3));
  last(far).answer();
  await settle();
  assert.equal(desk.standing(), 'current');
});

test('whatever happens in whatever order, only the answer to what is typed may be taken away', async () => {
  // A walk over all that can happen, from many starts; what is typed is known beside the desk.
  let seed = 1;
  const random = below => {
    seed = (seed * 1103515245 + 12345) % 2147483648;
    return Math.floor((seed / 2147483648) * below);
  };
  let taken = 0;
  for (let walk = 0; walk < 200; walk += 1) {
    const followed = {};
    const { desk, far, unread, pauses, clock } = await opened({ followed });
    let typed = job(1);
    let isRead = true;
    for (let step = 0; step < 40; step += 1) {
      const open = far.asked.filter(one => !one.isOver && !one.signal.aborted);
      const end = how => {
        const one = open[random(open.length)];
        if (one) {
          one.isOver = true;
          one[how](`run-${walk}-${step}`);
        }
      };
      [
        () => {
          typed = job(step + 2);
          desk.change(typed, 'typing');
        },
        () => {
          typed = job(step + 2);
          desk.change(typed, 'run');
        },
        () => {
          isRead = false;
          unread.set(new Set(['field-d']));
        },
        () => {
          isRead = true;
          unread.set(new Set());
        },
        () => end('answer'),
        () => end('answer'),
        () => end('answer'),
        () => end('refuse'),
        () => end('accept'),
        () => end('lose'),
        () => {
          const [run, handlers] = Object.entries(followed)[0] ?? [];
          if (run) {
            delete followed[run];
            handlers.onDone({ id: run, state: 'succeeded', key: `b3:${JSON.stringify(desk.state.running.asked)}` });
          }
        },
        () => {
          const [run, handlers] = Object.entries(followed)[0] ?? [];
          if (run) {
            delete followed[run];
            handlers.onDone({ id: run, state: 'failed', problem: { title: 'no' } });
          }
        },
        () => pauses.splice(0).forEach(go => go()),
        () => {
          clock.time += 800;
        },
        () => desk.ask(desk.state.job, 'run'),
      ][random(15)]();
      if (random(3) > 0) await settle();
      const { answer } = desk.state;
      if (!answer || !desk.owns(answer.key)) continue;
      taken += 1;
      assert.equal(isRead, true);
      assert.equal(answer.key, `b3:${JSON.stringify(typed)}`);
      assert.deepEqual(answer.answer.result, typed);
    }
    assert.ok(far.most <= 1, `${far.most} requests at a time`);
    desk.close();
  }
  assert.ok(taken > 200, `${taken} answers could be taken`);
});
