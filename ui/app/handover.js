// What leaves the page: files, programs, copies, paper. Nothing leaves it that is not the answer to the inputs on the screen,
// neither when it is asked for nor when it is there.
import { html, render, useState } from './lib.js';
import { t } from './text.js';
import * as api from './api.js';
import { declaredProgram, programText } from './program.js';
import { originOf } from './text-file.js';

function save(blob, name) {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(blob);
  link.download = name;
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

/** `take(accept, ending, query, whole)` fetches the answer in a form and saves it, under a name of its own where it has one; `owns(key)` says whether it is still that of
 *  the inputs on the screen. Also what went wrong. */
export function useHandOver({ name, answer, owns }) {
  // What went wrong with another answer is no trouble of this one.
  const [failed, setFailed] = useState({ key: null, why: null });
  const take = async (accept, ending, query = '', whole = `${name}.${ending}`) => {
    const { key } = answer;
    setFailed({ key, why: null });
    if (!owns(key)) return;
    try {
      const blob = await api.file(key, accept, query);
      if (owns(key)) save(blob, whole);
      else setFailed({ key, why: t('changed_meanwhile') });
    } catch (error) {
      setFailed({ key, why: error.problem?.detail || error.message });
    }
  };
  return [take, failed.key === answer.key ? failed.why : null];
}

/** Saves what the service keeps under a name: a model, a record, a process. It is no answer to inputs on the screen. */
export const saveKept = async (blob, name) => save(await blob, name);

/** Saves a text that was made of the answer with this key. */
export const saveText = (text, type, name, owns, key) => {
  if (owns(key)) save(new Blob([text], { type }), name);
};

/** Puts a page of its own on paper, made of the answer with this key. */
export function printAlone(page, owns, key) {
  if (!owns(key)) return;
  const paper = document.createElement('div');
  paper.className = 'paper';
  document.body.append(paper);
  render(page, paper);
  document.body.classList.add('paper-only');
  addEventListener(
    'afterprint',
    () => {
      document.body.classList.remove('paper-only');
      render(null, paper);
      paper.remove();
    },
    { once: true },
  );
  if (owns(key)) window.print();
}

/** A file of an answer is told from others by the beginning of its key. */
export const fileName = (id, answer) => `${id}-${answer.key.slice(3, 11)}`;

/** What the file was called whose text the job brought along, if it came as one: what is given back is called so, too. */
export function givenName(description, answer) {
  const said = declaredProgram(description);
  return said ? originOf(programText(said, answer.job)) : undefined;
}

/** The media type of a workbook. */
export const WORKBOOK = 'application/vnd.openxmlformats-officedocument.spreadsheetml.sheet';

/** Every form in which the answer can be had. */
export function Downloads({ id, description, answer, figure, stale, owns }) {
  const [take, trouble] = useHandOver({ name: fileName(id, answer), answer, owns });
  const has = type => description.media_types.includes(type);
  const given = givenName(description, answer);
  const button = (text, ...what) => html`<button type="button" disabled=${stale} onClick=${() => take(...what)}>${text}</button>`;
  return html`
    <span class="downloads" role="group" aria-label=${t('download')}><span class="quiet">${t('download')}</span>
      ${button('JSON', 'application/json', 'json')}
      ${has('text/csv') && button('CSV', 'text/csv', 'csv')}
      ${has(WORKBOOK) && button('XLSX', WORKBOOK, 'xlsx')}
      ${has('application/pdf') && button('PDF', 'application/pdf', 'pdf')}
      ${has('image/svg+xml') && figure && button('SVG', 'image/svg+xml', 'svg', `?figure=${figure.id}`)}
      ${has('text/x-gcode') && button(t('gcode'), 'text/x-gcode', 'nc', '', given)}
      ${has('text/x-diff') && button(t('diff'), 'text/x-diff', 'diff', '', given && `${given}.diff`)}
      <button type="button" disabled=${stale} onClick=${() => {
        if (owns(answer.key)) window.print();
      }}>${t('print')}</button>
    </span>
    ${trouble && html`<p class="fault" role="alert"><span>${trouble}</span></p>`}`;
}
