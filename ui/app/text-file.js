// A long text of the job that may come as a file: chosen, dropped, or typed. What comes is kept byte for byte: the field beside
// it that `x-text-file` names says which bytes its characters are.
import { html, useState, useRef } from './lib.js';
import { t, number } from './text.js';
import { at, changed, parts } from './schema.js';

const MEGA = 1_000_000;
/** Names of the files that texts came from in this window, by the texts. */
const origins = new Map();
const MOST_ORIGINS = 20;

/** What the file was called that a text came from. */
export const originOf = text => origins.get(text);

/** The text of bytes, and which bytes its characters are: `undefined` for UTF-8. */
export function textOf(bytes) {
  try {
    return { text: new TextDecoder('utf-8', { fatal: true, ignoreBOM: true }).decode(bytes), encoding: undefined };
  } catch {
    return { text: Array.from(bytes, byte => String.fromCharCode(byte)).join(''), encoding: 'latin_1' };
  }
}

/** What is typed, with the line ends that stood there before: an area of text has its own. */
export const withEnds = (typed, before) => {
  const ends = /\r\n?/.exec(before ?? '')?.[0];
  return ends ? typed.replace(/\r\n?|\n/g, ends) : typed;
};

/** The place of a field beside another. */
const beside = (path, way) => [...path.slice(0, -1), ...parts(`/${way}`)];

export function TextFile({ id, path, value, schema, set, described, invalid, label, plain, required, context }) {
  const [over, setOver] = useState(false);
  const [trouble, setTrouble] = useState(null);
  const picker = useRef(null);
  const most = schema.maxLength ?? Infinity;
  const take = async file => {
    if (!file) return;
    if (file.size > most) {
      setTrouble(t('text_file_large', { size: number(file.size / MEGA, 3), most: number(most / MEGA, 2) }));
      return;
    }
    try {
      const { text, encoding } = textOf(new Uint8Array(await file.arrayBuffer()));
      if (origins.size >= MOST_ORIGINS) origins.delete(origins.keys().next().value);
      origins.set(text, file.name);
      setTrouble(null);
      const way = beside(path, schema['x-text-file']);
      const whole = changed(context.value, path, text);
      // What was said of the last file says nothing of this one.
      context.set([], encoding || at(whole, way) !== undefined ? changed(whole, way, encoding) : whole);
    } catch (error) {
      setTrouble(t('file_unreadable', { why: error.message }));
    }
  };
  const drop = event => {
    if (event.dataTransfer.files.length === 0) return;
    event.preventDefault();
    setOver(false);
    take(event.dataTransfer.files[0]);
  };
  return html`
    <div class=${`text-file ${over ? 'over' : ''}`} onDragOver=${event => {
      event.preventDefault();
      setOver(true);
    }} onDragLeave=${() => setOver(false)} onDrop=${drop}>
      <label for=${id} class="label">${label}</label>
      <div class="actions">
        <button type="button" disabled=${context.disabled} onClick=${() => picker.current.click()}>${t('choose_file')}<span class="hidden">: ${plain}</span></button>
        <span class="quiet drop-hint">${originOf(value) ?? t('drop_hint')}</span>
      </div>
      ${trouble && html`<p class="fault" role="alert"><span>${trouble}</span></p>`}
      <textarea id=${id} rows="12" class="json" wrap="off" spellcheck=${false} autocomplete="off" value=${value ?? ''} disabled=${context.disabled}
        aria-describedby=${described} aria-invalid=${invalid ? 'true' : undefined} aria-required=${required ? 'true' : undefined} onInput=${event => {
          const typed = event.currentTarget.value;
          set(typed === '' && !required ? undefined : withEnds(typed, value), 'typing');
        }}></textarea>
      <input ref=${picker} type="file" class="hidden" tabindex="-1" aria-label=${`${t('choose_file')}: ${plain}`} data-text=${path.at(-1)}
        onChange=${event => {
          take(event.currentTarget.files[0]);
          event.currentTarget.value = '';
        }} />
    </div>`;
}
