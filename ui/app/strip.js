// The answer: what was asked, said in one sentence, with its numbers and the one thing to take away. It is always in view,
// and says so where it is not an answer to the inputs on the screen.
import { html } from './lib.js';
import { t, capital, number } from './text.js';
import { spreadOf, withSpread } from './digits.js';
import { flat } from './values.js';
import { useHandOver, fileName, givenName } from './handover.js';
import { isGivenBack } from './program.js';

/** Numbers beside the sentence. */
const MOST_NUMBERS = 3;
/** Numbers that differ by less, as a share, are one. */
const SAME = 1e-9;

/** The sentences of a text. */
export const sentences = text => (text === '' ? [] : text.split(/(?<=[.!?]) (?=[A-ZА-ЯЁ])/));

/** A number of the strip: what it is called, how it is written, its unit, what it means, and a second one beside it.
 *  @typedef {{ label: string, text: string, unit?: string, title?: string }} Headline */

/** The numbers that the declaration names, as far as the result has them.
 *  @returns {Headline[]} */
export function declared(description, result) {
  const rows = new Map(flat(description.output_schema, result, description.output_schema).map(row => [`/${row.path.join('/')}`, row]));
  const found = description.study_outputs.map(place => rows.get(place)).filter(row => typeof row?.value === 'number');
  // What has the same name would be told apart by nobody, and what is the same number says nothing new.
  const isSame = (one, other) =>
    one.label === other.label || (Math.abs(one.value - other.value) <= SAME * Math.abs(other.value) && one.unit === other.unit);
  const told = found.filter((row, index) => found.findIndex(other => isSame(row, other)) === index).slice(0, MOST_NUMBERS);
  return told.map(row => ({
    label: row.label,
    text: glance(row, spreadOf(result, row.path)?.spread),
    unit: row.unit,
    title: row.description,
  }));
}

/** A number as one reads it at a glance: with its uncertainty where that is not small, a share that is next to none or all
 *  as such. */
function glance({ value, schema }, spread) {
  if (spread > LARGE_SPREAD * Math.abs(value) && spread < Math.abs(value)) return withSpread(value, spread);
  if (schema.minimum === 0 && schema.maximum === 1) {
    if (value > 0 && value < SURE) return `< ${number(SURE)}`;
    if (value < 1 && value > 1 - SURE) return `> ${number(1 - SURE)}`;
  }
  return number(value, 3);
}
const LARGE_SPREAD = 0.02;
const SURE = 1e-3;

/** A sentence as short as it can be: what stands before its colon. */
const LONG = 90;
const brief = text => (text.length > LONG ? text.split(/: | \(/)[0].replace(/[.,;]$/, '') : text);

/** Why the answer is not one to the inputs on the screen. */
const WHY = {
  unread: 'answer_unread',
  wrong: 'answer_wrong',
  changed: 'answer_changed',
  computing: 'answer_computing',
  cancelled: 'answer_cancelled',
};

/** The answer to the question: its sentence, what limits it, its numbers, and the one thing to take away: `main`, `{ text,
 *  act() }`; without it the program, or the sheet to print.
 *  @param {{ id: string, description: any, answer: any, said: string, limits?: string, numbers: Headline[], main?: any, standing: string, owns: any, trouble: any }} props */
export function Strip({ id, description, answer, said, limits, numbers, main, standing, owns, trouble }) {
  const [take, refusal] = useHandOver({ name: fileName(id, answer), answer, owns });
  const isProgram = description.media_types.includes('text/x-gcode') && isGivenBack(description, answer.answer.result);
  const hand = () => {
    if (main) main.act();
    else if (isProgram) take('text/x-gcode', 'nc', '', givenName(description, answer));
    else if (owns(answer.key)) window.print();
  };
  const why = WHY[standing];
  return html`
    <section class=${`strip ${why ? `not-theirs ${standing}` : answer.answer.warnings.length > 0 ? 'warned' : ''}`} id="answer" aria-label=${t('answer')} tabindex="-1">
      <div class="told-first"><p class="verdict" aria-live="polite">${capital(said ?? '')}</p>
        ${limits && html`<p class="limits">${capital(brief(limits))}</p>`}</div>
      <dl class="headline">${numbers.map(row => html`<div key=${row.label} title=${row.title}><dt>${row.label}</dt><dd>${row.text}${row.unit && html`<small> ${row.unit}</small>`}</dd></div>`)}</dl>
      <div class="hand-over">
        <button type="button" id="take" class="primary" disabled=${Boolean(why)} onClick=${hand}>${main ? main.text : isProgram ? t('take_program') : t('take_sheet')}</button>
        ${why && html`<p class="stale-note" role="status">${t(why)}</p>`}
      </div>
      ${refusal && html`<p class="fault" role="alert"><span>${refusal}</span></p>`}
      ${trouble}
    </section>`;
}
