// Jobs that are on their way: which of them were started here, and what was asked.
import * as api from './api.js';

const nameOf = id => `precut-run-${id}`;

/** Notes what was asked with a job that this tab started. */
export function keepRun(id, asked) {
  try {
    sessionStorage.setItem(nameOf(id), JSON.stringify(asked));
  } catch {
    /* after a reload it is a job like those of others */
  }
}

/** What was asked with a job that this tab started; `null` for every other job. */
export function keptRun(id) {
  try {
    return JSON.parse(sessionStorage.getItem(nameOf(id)));
  } catch {
    return null;
  }
}

/** What a job computes, by whomever it was started: `{ calculator, job }`; `null` where the service does not know it, or
 *  not any more. */
export async function inputOf(id) {
  try {
    return await api.jobInput(id);
  } catch (error) {
    if (error instanceof api.Refused && [404, 410].includes(error.status)) return null;
    throw error;
  }
}
