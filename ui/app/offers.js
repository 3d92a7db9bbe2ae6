// What an answer offers to do about its job: numbers that buy something when they give way (`x-knobs`), and settings that are
// better than the present one (`x-choices`). Which lists these are, and which fields they stand for, the schema of the result
// says. What is pressed goes into the job and is computed anew.
import { html, useState, useEffect } from './lib.js';
import { t, number, unitOf } from './text.js';
import { at, changed, parts, fieldAt, listsWith, within } from './schema.js';
import { flat, shownValue } from './values.js';

const WIDTH = 1000;
/** More bars than these are asked for. */
const MOST_BARS = 8;
const STEP_PERCENT = 1;
/** Digits of a number that is turned. */
const DIGITS = 6;

/** A single number of a result with its label and unit. */
const numberAt = ({ output_schema: root }, result, path) => flat(root, result, root).find(row => row.path.join('/') === path.join('/'));
const signed = percent => `${percent < 0 ? '−' : '+'}${number(Math.abs(percent), 3)} %`;

/** Whether it says what its numbers buy, or has better settings. */
export const hasOffers = ({ output_schema: root }, result) =>
  ['x-knobs', 'x-choices'].some(word => listsWith(word, root, result).some(({ items }) => items.length > 0));

/** The numbers of a job that buy something, each one percent to the side on which it is looser. */
export function knobsOf({ output_schema: root, input_schema: inputs }, { result, input }) {
  return listsWith('x-knobs', root, result).flatMap(({ said, items }) =>
    items.flatMap(item => {
      const path = parts(item[said.pointer]);
      const before = at(input, path);
      const field = fieldAt(inputs, input, path);
      const gain = item[said.gain];
      if (typeof before !== 'number' || typeof gain !== 'number' || !field) return [];
      const side = item[said.looser] === 'less' ? -1 : 1;
      const after = Number((before * (1 + (side * STEP_PERCENT) / 100)).toPrecision(DIGITS));
      return [{ pointer: item[said.pointer], path, label: field.label, field: field.schema, before, after, gain, of: parts(said.of) }];
    }),
  );
}

/** The job with a choice in place of its setting: what it sets, without what would contradict it. */
export function chosenJob(job, result, item, { sets, clears = [] }) {
  const value = from => (from.startsWith('/') ? at(result, parts(from)) : item[from]);
  const set = Object.entries(sets).reduce((whole, [place, from]) => changed(whole, parts(place), value(from)), job);
  return clears.reduce((whole, place) => (at(whole, parts(place)) === undefined ? whole : changed(whole, parts(place), undefined)), set);
}

/** `apply(job)` does nothing while the answer is not that of the inputs. */
export function Offers({ description, answer, isCurrent, apply }) {
  const { result } = answer.answer;
  const root = description.output_schema;
  return html`
    <${Knobs} ...${{ description, answer, isCurrent, apply }} />
    ${listsWith('x-choices', root, result)
      .filter(({ items }) => items.length > 0)
      .map(
        list =>
          html`<${Choices} key=${list.label} ...${{ list, root, result }} apply=${item => apply(chosenJob(answer.job, result, item, list.said))} />`,
      )}`;
}

function Knobs({ description, answer, isCurrent, apply }) {
  const [all, setAll] = useState(false);
  // What was pressed last, and what it came to.
  const [pressed, setPressed] = useState(null);
  const knobs = knobsOf(description, answer.answer);
  const goal = knobs.length > 0 ? numberAt(description, answer.answer.result, knobs[0].of) : null;
  useEffect(() => {
    // Another answer than the one asked for by the press makes the comparison none.
    setPressed(now => (now && at(answer.answer.input, now.path) !== now.after && answer.key !== now.key ? null : now));
  }, [answer.key]);
  if (knobs.length === 0 || !goal) return null;
  const most = Math.max(...knobs.map(({ gain }) => gain));
  const shown = all ? knobs : knobs.slice(0, MOST_BARS);
  const came = pressed && pressed.key !== answer.key && isCurrent ? (100 * (goal.value - pressed.goal)) / pressed.goal : null;
  const press = knob => {
    if (!isCurrent) return;
    setPressed({ ...knob, goal: goal.value, key: answer.key });
    apply(changed(answer.job, knob.path, knob.after));
  };
  return html`
    <section class="picture knobs" aria-label=${t('knobs_title', { name: within(goal.label) })}>
      <h2>${t('knobs_title', { name: within(goal.label) })}</h2>
      <ul>${shown.map(
        knob => html`<li key=${knob.pointer}><button type="button" data-pointer=${knob.pointer} onClick=${() => press(knob)}>
        <span class="knob-name">${knob.label} <small>${number(knob.before, DIGITS)} → ${number(knob.after, DIGITS)} ${unitOf(knob.field)}</small></span>
        <svg viewBox=${`0 0 ${WIDTH} 14`} preserveAspectRatio="none" aria-hidden="true"><rect class="bar-given" x="0" y="1" width=${Math.max((WIDTH * knob.gain) / most, 4)} height="12" /></svg>
        <span class="number">${signed(-knob.gain)}</span></button></li>`,
      )}</ul>
      ${knobs.length > shown.length && html`<button type="button" class="more" onClick=${() => setAll(true)}>${t('and_more', { count: knobs.length - shown.length })}</button>`}
      <p class="quiet hint knob-came" role="status">${came === null ? t('knobs_hint') : t('knob_came', { name: pressed.label, goal: within(goal.label), before: number(pressed.goal, 5), after: number(goal.value, 5), unit: goal.unit, came: signed(came), told: signed(-pressed.gain) })}</p>
    </section>`;
}

function Choices({ list, root, result, apply }) {
  const { said, items, schema, label } = list;
  // Beside a number what it is now.
  const gainOf = ({ path, value }) => {
    const now = said.against?.[path.at(-1)] && at(result, parts(said.against[path.at(-1)]));
    return typeof now === 'number' && now > 0 ? signed((100 * (value - now)) / now) : null;
  };
  return html`
    <section class="picture offers" aria-label=${label}>
      <h2>${label}</h2>
      <ol>${items.map(
        (item, index) => html`<li key=${index}>
        <dl>${flat(schema, item, root).map(row => html`<div key=${row.path.join('/')} title=${row.description}><dt>${row.label}</dt><dd>${shownValue(row.value, row.schema, null, 4)}${row.unit && html`<small> ${row.unit}</small>`}${gainOf(row) && html` <small class="gain">${gainOf(row)}</small>`}</dd></div>`)}</dl>
        <button type="button" onClick=${() => apply(item)}>${t('use_this')}<span class="hidden">: ${label} ${index + 1}</span></button></li>`,
      )}</ol>
    </section>`;
}
