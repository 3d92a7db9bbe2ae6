// Settings of a picture put at another place of it: which job stands there the calculator knows, the page does not.
import { at, changed, difference, parts } from './schema.js';

/** A job with what differs between two others, the same as the service has it and one that stands elsewhere. What the service
 *  has under another name, a speed as a speed of rotation, goes with it. */
export function followed(job, filled, moved) {
  return difference(filled, moved).reduce((whole, [place, value]) => {
    const path = parts(place);
    const [beside, known] = [at(whole, path.slice(0, -1)), at(filled, path.slice(0, -1))];
    const isRecord = beside && typeof beside === 'object' && !Array.isArray(beside);
    const others = isRecord ? Object.keys(beside).filter(name => !(name in (known ?? {})) && beside[name] !== null) : [];
    const bare = others.reduce((rest, name) => changed(rest, [...path.slice(0, -1), name], undefined), whole);
    return changed(bare, path, value);
  }, job);
}

/** The settings of a figure, each with the index of its panel. */
export const settingsOf = figure =>
  figure.panels.flatMap(({ items }, panel) => items.filter(({ kind }) => kind === 'setting').map(setting => ({ ...setting, panel })));

/** What a place is in a request. */
export const placeOf = (figure, setting, x, y = 0) => ({ figure: figure.id, setting: setting.name, x, y });

/** Of a desk: the jobs for which other places of its pictures stand. */
export class Places {
  constructor(desk) {
    this.desk = desk;
    /** The job of the answer as the service filled it in, by the key of the answer. */
    this.filled = null;
    /** The place to go to after the one that is asked for. */
    this.next = null;
    this.isBusy = false;
  }

  /** The job that stands there, made of what was asked with the answer shown. */
  async jobAt(place, signal) {
    const {
      service,
      state: {
        answer: { key, job },
      },
    } = this.desk;
    if (this.filled?.key !== key) this.filled = { key, job: service.jobOf(key) };
    const [filled, moved] = await Promise.all([this.filled.job, service.jobAt(key, place, signal)]);
    return followed(job, filled.job, moved.job);
  }

  /** Puts a setting there; of places that are passed by quickly the last one counts. */
  async put(place, how) {
    this.next = { place, how };
    if (this.isBusy) return;
    this.isBusy = true;
    try {
      while (this.next) {
        const { place: to, how: then } = this.next;
        this.next = null;
        const { job } = this.desk.state;
        const moved = await this.jobAt(to);
        if (this.desk.isClosed || this.desk.state.job !== job) continue;
        if (difference(job, moved).length > 0) this.desk.change(moved, then);
        else if (then === 'run' && this.desk.state.waiting) this.desk.ask(job, 'run');
      }
    } finally {
      this.isBusy = false;
    }
  }
}
