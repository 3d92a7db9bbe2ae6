// Answers beside the one shown: what its job gives with a little changed, for a scrubber or a point that is dragged.
import { useState, useEffect, useRef } from './lib.js';
import * as api from './api.js';

/** Answers kept while the page is open. */
const KEPT = 400;

/** Follows a job as fast as the service answers; one that is passed by before its turn is never sent. `tag` names the job,
 *  `null` asks for none; `job(signal)` gives it. Gives the last answer found: `{ tag, job, answer, figures }` or
 *  `{ tag, problem }`.
 *  @param {string} id @param {string | null} tag @param {(signal: AbortSignal) => any} job */
export function useProbe(id, tag, job) {
  const [found, setFound] = useState(null);
  const line = useRef(null);
  if (!line.current) line.current = { wanted: null, busy: false, gone: false, kept: new Map(), control: new AbortController() };
  const own = line.current;
  useEffect(
    () => () => {
      own.gone = true;
      own.control.abort();
    },
    [],
  );
  useEffect(() => {
    own.wanted = tag === null ? null : { tag, job };
    if (tag === null) {
      setFound(null);
      return;
    }
    if (!own.busy) next();
  }, [tag]);

  const next = async () => {
    own.busy = true;
    while (own.wanted && !own.gone) {
      const asked = own.wanted;
      own.wanted = null;
      let answer = own.kept.get(asked.tag);
      if (!answer) {
        answer = await fetched(id, asked, own.control.signal);
        if (!answer) break;
        if (own.kept.size >= KEPT) own.kept.delete(own.kept.keys().next().value);
        if (!answer.problem) own.kept.set(asked.tag, answer);
      }
      if (!own.gone) setFound(answer);
    }
    own.busy = false;
  };
  return found;
}

async function fetched(id, { tag, job: made }, signal) {
  let job;
  try {
    // Too many at once: asked again when the service says.
    job = await api.patient(() => made(signal), signal);
    return { tag, job, ...(await api.patient(() => api.answered(id, job, signal), signal)) };
  } catch (error) {
    if (error.name === 'AbortError') return null;
    return { tag, job, problem: error.problem || { title: error.message } };
  }
}
