// Lists and tables of a job: names to tick, lines of numbers, grids, parts, values by name.
import { html, useState, useEffect } from './lib.js';
import { t, capital, typed, parsed, unitOf } from './text.js';
import { resolve, kindOf, variants, variantOf, variantName, blank, labelOf, spoken } from './schema.js';
import { fieldId, isLeaf, nudged, rangeText, defaultText, optionText, Faults } from './fields.js';
import { Body, Field } from './form.js';

/** Most columns of a list that is shown as a grid. */
const WIDEST_GRID = 4;
/** A list longer than this is shown shortened until asked for. */
const LONG_LIST = 40;

/** A list: tick boxes for names, a line of numbers, a grid for small objects, parts for larger ones. */
export function List({ name, schema, path, value, context }) {
  const items = resolve(schema.items, context.root);
  const [whole, setWhole] = useState(false);
  if (kindOf(items) === 'enum') return html`<${Ticks} schema=${schema} items=${items} path=${path} value=${value} context=${context} />`;
  if (kindOf(items) === 'number') return html`<${Numbers} name=${name} schema=${schema} path=${path} value=${value} context=${context} />`;
  if (kindOf(items) === 'string') return html`<${Words} name=${name} schema=${schema} path=${path} value=${value} context=${context} />`;
  const full = schema.maxItems !== undefined && value.length >= schema.maxItems;
  const add = () => {
    // A new one like the last one: supports, segments, zones come in rows.
    const last = value.at(-1);
    context.set(path, [...value, last === undefined || kindOf(items) === 'choice' ? blank(items, context.root) : structuredClone(last)]);
  };
  const remove = index => context.set(path, value.filter((_, other) => other !== index));
  const shown = whole ? value : value.slice(0, LONG_LIST);
  const fields = kindOf(items) === 'object' ? Object.entries(items.properties).map(([field, part]) => ({ name: field, schema: resolve(part, context.root) })) : [];
  const plain = fields.filter(field => isLeaf(field.schema));
  const isGrid = fields.length > 0 && plain.length === fields.length && fields.length <= WIDEST_GRID && plain.every(field => kindOf(field.schema) === 'number');
  const label = index => `${labelOf(name, schema)} ${index + 1}`;
  return html`
    ${isGrid && value.length > 0 ? html`
      <div class="grid-scroll"><table class="grid">
        <thead><tr>${plain.map(field => html`<th scope="col" title=${field.schema.description}>${labelOf(field.name, field.schema)}<span class="unit">${unitOf(field.schema)}</span></th>`)}<th><span class="hidden">${t('remove')}</span></th></tr></thead>
        <tbody>${shown.flatMap((row, index) => [html`<tr key=${index}>
          ${plain.map(field => html`<td><${Cell} field=${field} path=${[...path, index, field.name]} value=${row[field.name]} required=${(items.required || []).includes(field.name)} context=${context} row=${label(index)} /></td>`)}
          <td><button type="button" class="icon" disabled=${value.length <= (schema.minItems || 0)} aria-label=${`${t('remove')}: ${label(index)}`} onClick=${() => remove(index)}>×</button></td>
        </tr>`, html`<${RowFaults} key=${`faults ${index}`} ...${{ plain, path: [...path, index], context }} />`])}</tbody>
      </table></div>`
    : shown.map((item, index) => html`
      <fieldset class="item" key=${index} id=${fieldId([...path, index])}>
        <legend><span><span class="hidden">${labelOf(name, schema)} </span>${index + 1}${kindOf(items) === 'choice' ? ` · ${variantName(variantOf(variants(items, context.root), item), context.root) ?? ''}` : ''}</span>
          <button type="button" class="icon" disabled=${value.length <= (schema.minItems || 0)} aria-label=${`${t('remove')}: ${label(index)}`} onClick=${() => remove(index)}>×</button></legend>
        <${Faults} faults=${context.errorsAt([...path, index])} id=${`${fieldId([...path, index])}-item`} names=${context.names} />
        <${Body} name=${name} schema=${items} path=${[...path, index]} value=${item} context=${context} />
      </fieldset>`)}
    ${value.length > shown.length && html`<button type="button" class="more" onClick=${() => setWhole(true)}>${t('show_all', { count: value.length })}</button>`}
    <button type="button" class="more" disabled=${full} onClick=${add}>${t('add_item')}<span class="hidden"> ${labelOf(name, schema)}</span></button>`;
}

/** What is wrong in a row of a grid: below it, as wide as the grid, so that no column moves. */
function RowFaults({ plain, path, context }) {
  const found = [...context.errorsAt(path).map(fault => ({ ...fault, id: fieldId(path) })), ...plain.flatMap(field => context.errorsAt([...path, field.name]).map(fault => ({ ...fault, id: fieldId([...path, field.name]) })))];
  if (found.length === 0) return null;
  return html`<tr class="row-faults"><td colspan=${plain.length + 1}>${found.map(({ id, detail }, index) => html`<p class="fault" key=${index} id=${`${id}-fault`}>${capital(spoken(detail, context.names))}</p>`)}</td></tr>`;
}

/** A number in a grid: its name is that of row and column. */
function Cell({ field, path, value, required, context, row }) {
  const [draft, setDraft] = useState(null);
  const faults = context.errorsAt(path);
  const label = labelOf(field.name, field.schema);
  useEffect(() => {
    const typed_ = draft === null ? null : parsed(draft);
    if (draft !== null && !Number.isNaN(typed_) && !Object.is(typed_ ?? undefined, value)) setDraft(null);
  }, [value]);
  const read = draft === null ? value : parsed(draft);
  const wrong = Number.isNaN(read) || (required && read === null);
  const show = () => context.setHelp({ label, symbol: field.schema['x-symbol'], range: rangeText(field.schema), description: [field.schema.description, defaultText(field.schema)].join(' ') });
  const id = fieldId(path);
  const take = text => {
    setDraft(text);
    const next = parsed(text);
    if (!Number.isNaN(next) && !(required && next === null)) context.set(path, next === null ? undefined : next, 'typing');
  };
  const key = event => {
    if (event.key !== 'ArrowUp' && event.key !== 'ArrowDown') return;
    event.preventDefault();
    setDraft(null);
    context.set(path, nudged(value, field.schema, event.key === 'ArrowUp' ? 1 : -1, event.shiftKey), 'typing');
  };
  return html`
    <input id=${id} type="text" inputmode="decimal" autocomplete="off" value=${draft ?? typed(value)} aria-label=${`${row}: ${label}`} onFocus=${event => { show(); event.currentTarget.select(); }} onMouseEnter=${show}
      title=${rangeText(field.schema)} placeholder=${field.schema.default !== undefined ? typed(field.schema.default) : ''} aria-invalid=${faults.length || wrong ? 'true' : undefined} aria-describedby=${faults.length ? `${id}-fault` : undefined}
      onInput=${event => take(event.currentTarget.value)} onBlur=${() => { if (!wrong) setDraft(null); }} onKeyDown=${key} />`;
}

/** Which of several things are wanted. */
function Ticks({ schema, items, path, value, context }) {
  const flip = (option, on) => {
    const next = on ? items.enum.filter(name => name === option || value.includes(name)) : value.filter(name => name !== option);
    if (next.length >= (schema.minItems || 0)) context.set(path, next);
    else context.set(path, [...value]);
  };
  return html`
    <div class="ticks" id=${fieldId(path)}>
      ${items.enum.map(option => html`<label key=${option}><input type="checkbox" checked=${value.includes(option)} onChange=${event => flip(option, event.currentTarget.checked)} /> ${optionText(items, option)}</label>`)}
    </div>`;
}

/** Numbers in one line. */
function Numbers({ name, schema, path, value, context }) {
  const [draft, setDraft] = useState(null);
  const read = (draft ?? '').split(/[;\s]+/).filter(Boolean).map(parsed);
  const wrong = draft !== null && read.some(Number.isNaN);
  const take = text => {
    setDraft(text);
    const next = text.split(/[;\s]+/).filter(Boolean).map(parsed);
    if (!next.some(Number.isNaN)) context.set(path, next, 'typing');
  };
  const id = fieldId(path);
  return html`
    <div class="line"><input id=${id} type="text" aria-label=${`${labelOf(name, schema)} (${t('numbers_hint')})`} placeholder=${t('numbers_hint')} value=${draft ?? value.map(typed).join('; ')}
      aria-invalid=${wrong ? 'true' : undefined} onInput=${event => take(event.currentTarget.value)} onBlur=${() => { if (!wrong) setDraft(null); }} />
    <span class="unit">${unitOf(schema['x-unit'] ? schema : schema.items)}</span></div>
    <${Faults} faults=${wrong ? [{ detail: t('not_a_number') }] : []} id=${`${id}-fault`} />`;
}

/** Names in one line. */
function Words({ name, schema, path, value, context }) {
  return html`
    <div class="line"><input id=${fieldId(path)} type="text" aria-label=${`${labelOf(name, schema)} (${t('words_hint')})`} placeholder=${t('words_hint')} value=${value.join('; ')}
      onChange=${event => context.set(path, event.currentTarget.value.split(/[;,]+/).map(word => word.trim()).filter(Boolean))} /></div>`;
}

/** Values by names that the schema does not know. */
export function MapFields({ name, schema, path, value, context }) {
  const [fresh, setFresh] = useState('');
  const inner = resolve(schema.additionalProperties && typeof schema.additionalProperties === 'object' ? schema.additionalProperties : { type: 'number' }, context.root);
  const add = () => {
    const word = fresh.trim();
    if (!word || word in value) return;
    context.set([...path, word], blank(inner, context.root));
    setFresh('');
  };
  return html`
    ${Object.entries(value).map(([word, part]) => html`
      <div class="pair" key=${word}><${Field} name=${word} schema=${inner} path=${[...path, word]} value=${part} required=${true} context=${context} />
        <button type="button" class="icon" aria-label=${`${t('remove')}: ${word}`} onClick=${() => context.set([...path, word], undefined)}>×</button></div>`)}
    <div class="line"><input type="text" aria-label=${`${labelOf(name, schema)}: ${t('name')}`} placeholder=${t('name')} value=${fresh} onInput=${event => setFresh(event.currentTarget.value)}
      onKeyDown=${event => { if (event.key === 'Enter') { event.preventDefault(); add(); } }} /><button type="button" onClick=${add}>${t('add')}</button></div>`;
}
