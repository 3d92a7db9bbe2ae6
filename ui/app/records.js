// Machines, tools and materials by name: a picker that finds them by everything that they are called, and where the
// numbers come from that they fill in. Which of them a job may name is said by the calculator's declaration.
import { html, useState, useMemo, unique } from './lib.js';
import { t, number, plural } from './text.js';
import { changed, parts, pointer } from './schema.js';

/** Most hits that are shown. */
const MOST_HITS = 12;
/** Where the records of a kind are listed. */
export const FOLDER = { machine: 'machines', tool: 'tools', material: 'materials' };

const CYRILLIC = [
  'a',
  'b',
  'v',
  'g',
  'd',
  'e',
  'zh',
  'z',
  'i',
  'y',
  'k',
  'l',
  'm',
  'n',
  'o',
  'p',
  'r',
  's',
  't',
  'u',
  'f',
  'x',
  'ts',
  'ch',
  'sh',
  'shch',
  '',
  'y',
  '',
  'e',
  'yu',
  'ya',
];
const LATIN = { ё: 'e', ä: 'a', á: 'a', à: 'a', ö: 'o', ó: 'o', ü: 'u', ú: 'u', ß: 'ss' };
/** A name as the service compares it: small letters and digits alone, Cyrillic letters of GOST in Latin ones, `kh` as `x`. */
export function fold(text) {
  let folded = '';
  for (const letter of text.toLowerCase()) {
    if (letter === 'h' && folded.endsWith('k')) folded = `${folded.slice(0, -1)}x`;
    else if (/[a-z0-9]/.test(letter)) folded += letter;
    else if (letter >= 'а' && letter <= 'я') folded += CYRILLIC[letter.codePointAt(0) - 'а'.codePointAt(0)];
    else folded += LATIN[letter] ?? '';
  }
  return folded;
}

/** Everything that a record is called. */
const namesOf = record =>
  [record.name, ...Object.values(record.names || {}).flat(), record.insert, record.holder, record.title].filter(
    name => typeof name === 'string',
  );

/** The records as they are searched. */
export const indexOf = records => (records || []).map(record => ({ record, folded: namesOf(record).map(fold) }));

/** The records that a text fits, best first: called so, beginning so, having it somewhere, all its words somewhere. */
export function find(index, text) {
  const whole = fold(text);
  const words = text.split(/\s+/).map(fold).filter(Boolean);
  const rank = ({ folded }) => {
    const places = folded.map(name => [name.indexOf(whole), name.length === whole.length]).filter(([at]) => at >= 0);
    if (places.some(([, isAll]) => isAll)) return 0;
    if (places.some(([at]) => at === 0)) return 1;
    if (places.length > 0) return 2;
    return words.length > 1 && words.every(word => folded.some(name => name.includes(word))) ? 3 : null;
  };
  return index
    .map((entry, place) => ({ ...entry, rank: rank(entry), place }))
    .filter(entry => entry.rank !== null)
    .sort((one, other) => one.rank - other.rank || one.place - other.place)
    .map(entry => entry.record);
}

/** What a text says of a tool in ISO codes, `CNMG120408 PCLNR2525M12`; `null` where it says nothing. */
export function codesOf(text) {
  const words = text
    .trim()
    .toUpperCase()
    .split(/[\s,;]+/)
    .filter(Boolean);
  const insert = words.find(word => /^[A-Z]{4}\d\d[0-9T]\d/.test(word));
  const holder = words.find(word => word !== insert && /^([A-Z]\d{2}[A-Z]-)?[A-Z]{5}\d/.test(word));
  if ((!insert && !holder) || words.length !== [insert, holder].filter(Boolean).length) return null;
  return { ...(insert && { insert }), ...(holder && { holder }) };
}

/** The name or the codes that stand in a job. */
export const nameOf = value =>
  typeof value === 'string' ? value : (value?.name ?? ([value?.insert, value?.holder].filter(Boolean).join(' ') || ''));

/** A job's value with another name in it. What stands beside the name stays, and so do the fields that a calculator has
 *  there itself. */
export function named(value, name, isDeclared) {
  const beside =
    value && typeof value === 'object'
      ? Object.fromEntries(Object.entries(value).filter(([field]) => !['name', 'insert', 'holder'].includes(field)))
      : {};
  const isAlone = Object.keys(beside).length === 0 && !isDeclared;
  const codes = name && typeof name === 'object';
  if (!name) return isDeclared && Object.keys(beside).length > 0 ? beside : undefined;
  return isAlone && !codes ? name : { ...(codes ? name : { name }), ...beside };
}

/** The fields at which the job stands in place of a record: numbers, and names of a part alone, as `/shaft/material`. */
export function overruled(said) {
  const { origins, resources } = said || {};
  const numbers = (origins || []).filter(({ parts: of }) => of.every(({ from }) => from === 'job')).map(origin => origin.pointer);
  const ofParts = resources?.material
    ? Object.keys(resources)
        .filter(place => !FOLDER[place])
        .map(place => `/${place.replace('_', '/')}`)
    : [];
  return [...ofParts, ...numbers];
}

/** The record that a part of a number is from: the material of a part of the job before that of all of it. */
const recordOf = (resources, from, place) => resources?.[`${place.split('/')[1]}_${from}`] ?? resources?.[from];

/** What the sources of a material say of its force, side by side on one scale: they are compared at one thickness of the chip,
 *  as their constants trade with their exponents. `used` is the row that the number is from. */
function Sources({ rows, used }) {
  const most = Math.max(...rows.map(row => row.value_n_per_mm2));
  const words = row =>
    [t(`certainty_${row.certainty}`), row.row === used && t('source_used'), row.superseded && t('source_superseded')]
      .filter(Boolean)
      .join(' · ');
  return html`
    <table class="sources"><caption>${t('sources_say', { thickness: number(rows[0].at_chip_thickness_mm) })}</caption><tbody>${rows.map(
      row => html`<tr key=${row.row} data-used=${row.row === used ? '' : undefined}><td class="number">${number(row.value_n_per_mm2, 4)}</td>
      <td><span class="share" style=${{ width: `${(100 * row.value_n_per_mm2) / most}%` }} aria-hidden="true"></span>
        ${row.address ? html`<a href=${row.address} rel="noreferrer">${row.source}</a>` : row.source} <span class="quiet">${words(row)}</span></td></tr>`,
    )}</tbody></table>`;
}

/** Which row of a material's sources a number is from; `undefined` where it is from none. */
const rowOf = ({ from, path }) => (from === 'material' ? /^\/kienzle\/(\d+)/.exec(path ?? '')?.[1] : undefined);

/** Where a number comes from, in a few lines, and what other sources say of it. */
export function Origin({ origin, resources, libraries, unit }) {
  return html`<ul class="origin">${origin.parts.map(part => {
    const row = rowOf(part);
    const rows =
      row && libraries?.materials?.find(({ name }) => name === recordOf(resources, part.from, origin.pointer)?.name)?.force_sources;
    const record = recordOf(resources, part.from, origin.pointer);
    const name = record ? `${record.name}${record.revision ? `@${record.revision}` : ''}` : '';
    const size = typeof part.value === 'number' ? `${number(part.value)} ${unit || ''}`.trim() : '';
    const unsure = part.relative_standard_uncertainty_percent ? `±${number(part.relative_standard_uncertainty_percent, 2)} %` : '';
    const certainty = part.certainty ? t(`certainty_${part.certainty}`) : '';
    return html`<li><span>${[[t(`record_${part.from}`), name].filter(Boolean).join(' '), [size, unsure].filter(Boolean).join(' '), certainty].filter(Boolean).join(' · ')}</span>
      ${part.source && html`<span class="quiet">${part.address ? html`<a href=${part.address} rel="noreferrer">${part.source}</a>` : part.source}</span>`}
      ${rows?.length > 1 && html`<${Sources} rows=${rows} used=${Number(row)} />`}</li>`;
  })}</ul>`;
}

/** One picker. */
function Picker({ kind, records, value, isDeclared, set, faults, context }) {
  const [draft, setDraft] = useState(null);
  const [chosen, setChosen] = useState(0);
  const [group, setGroup] = useState('');
  const id = useMemo(() => unique(`record-${kind}`), []);
  const index = useMemo(() => indexOf(records), [records]);
  const name = nameOf(value);
  const groups = kind === 'material' ? ['P', 'M', 'K', 'N', 'S', 'H'] : [];
  const inGroup = record => !group || record.iso513_group === group;
  const all =
    draft === null ? [] : (draft.trim() === '' || draft === name ? index.map(({ record }) => record) : find(index, draft)).filter(inGroup);
  const hits = group || draft?.trim() ? all.slice(0, group ? all.length : MOST_HITS) : all;
  const codes = kind === 'tool' && draft ? codesOf(draft) : null;
  const isOpen = draft !== null && (hits.length > 0 || codes);
  const close = () => {
    setDraft(null);
    setChosen(0);
    setGroup('');
  };
  const put = next => {
    set(named(value, next, isDeclared));
    close();
  };
  const take = () => {
    if (draft === null || draft === name) {
      close();
      return;
    }
    if (draft.trim() === '') put(null);
    else if (hits[chosen] && (!codes || fold(draft) === fold(hits[chosen].name))) put(hits[chosen].name);
    else put(codes || draft.trim());
  };
  const onKeyDown = event => {
    if (event.key === 'Escape') {
      close();
      return;
    }
    if (event.key === 'Enter') {
      event.preventDefault();
      take();
      return;
    }
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    if (draft === null) setDraft(name);
    else setChosen((chosen + step + hits.length) % Math.max(hits.length, 1));
  };
  const record = records?.find(one => one.name === name.split('@')[0]);
  return html`
    <div class=${`row record ${faults.length ? 'faulty' : ''}`} data-record=${kind}>
      <label class="label" for=${id}>${t(`record_${kind}`)}</label>
      <span class="control wide"><input id=${id} type="text" role="combobox" autocomplete="off" spellcheck=${false} aria-expanded=${isOpen ? 'true' : 'false'} aria-controls=${`${id}-hits`} aria-autocomplete="list"
        aria-activedescendant=${isOpen && hits[chosen] ? `${id}-${chosen}` : undefined} aria-invalid=${faults.length > 0 ? 'true' : undefined} disabled=${context.disabled}
        value=${draft ?? name} placeholder=${t(`record_${kind}_hint`)} onFocus=${event => {
          setDraft(name);
          event.currentTarget.select();
        }} onBlur=${take}
        onInput=${event => {
          setDraft(event.currentTarget.value);
          setChosen(0);
        }} onKeyDown=${onKeyDown} />
        ${name && draft === null && html`<button type="button" class="icon" data-act="clear" title=${t('remove')} aria-label=${`${t('remove')}: ${t(`record_${kind}`)}`} onClick=${() => put(null)}>×</button>`}</span>
      ${record?.title && draft === null && html`<p class="record-title">${record.title}</p>`}
      ${
        draft !== null &&
        groups.length > 0 &&
        html`<div class="chips" role="group" aria-label=${t('record_group')}>${groups.map(
          word => html`
        <button type="button" key=${word} aria-pressed=${group === word} onMouseDown=${event => event.preventDefault()} onClick=${() => {
          setGroup(group === word ? '' : word);
          setChosen(0);
        }}>${word}</button>`,
        )}</div>`
      }
      ${
        isOpen &&
        html`<ul class="hits" role="listbox" id=${`${id}-hits`} aria-label=${t(`record_${kind}`)}>
        ${
          codes &&
          html`<li role="option" aria-selected="false" onMouseDown=${event => {
            event.preventDefault();
            put(codes);
          }}><strong>${[codes.insert, codes.holder].filter(Boolean).join(' ')}</strong> <span>${t('record_by_codes')}</span></li>`
        }
        ${hits.map(
          (
            hit,
            place,
          ) => html`<li key=${hit.name} id=${`${id}-${place}`} role="option" aria-selected=${place === chosen ? 'true' : 'false'} onMouseDown=${event => {
            event.preventDefault();
            put(hit.name);
          }}>
          <strong>${hit.name}</strong> <span>${hit.title}${hit.built_in === false ? ` · ${t('record_own')}` : ''}</span></li>`,
        )}</ul>`
      }
      ${faults.length > 0 && html`<p class="fault">${faults.map(fault => html`<span>${fault.detail}</span>`)}</p>`}
    </div>`;
}

/** The pickers of a job, and how what they name stands to it. */
export function Records({ kinds, declared, value, onChange, libraries, said, context }) {
  const there = said?.origins || [];
  const ofJob = overruled(said);
  const filled = there.filter(({ parts: of }) => of.some(({ from }) => from !== 'job')).length;
  const below = place => [...context.errors].filter(([at]) => at === place || at.startsWith(`${place}/`)).flatMap(([, faults]) => faults);
  const useRecords = () => onChange(ofJob.reduce((job, place) => changed(job, parts(place), undefined), value));
  return html`
    <section class="records" aria-label=${t('records')}>
      ${kinds.map(
        kind => html`<${Picker} key=${kind} kind=${kind} records=${libraries?.[FOLDER[kind]]} value=${value[kind]} isDeclared=${declared.includes(kind)} faults=${below(pointer([kind]))} context=${context}
        set=${part => onChange(changed(value, [kind], part))} />`,
      )}
      <p class="quiet"><a href="#/library">${t('records_mine')}</a></p>
      ${
        kinds.some(kind => nameOf(value[kind])) &&
        there.length > 0 &&
        html`<p class="quiet" role="status">${plural('record_fills', filled)}
        ${ofJob.length > 0 && html` <span>${plural('record_overruled', ofJob.length)}</span> <button type="button" class="quiet-button" data-act="use-records" onClick=${useRecords}>${t('record_use')}</button>`}</p>`
      }
    </section>`;
}
