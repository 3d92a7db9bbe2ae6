// Lists and tables of a job: names to tick, lines of numbers, grids, parts, values by name.
import { html, useState, useEffect } from './lib.js';
import { t, capital, typed, unitOf } from './text.js';
import { read } from './number.js';
import { pasted, rowsOf } from './paste.js';
import { resolve, kindOf, variants, variantOf, variantName, blank, labelOf, spoken } from './schema.js';
import { fieldId, isLeaf, mark, explained, useNumber, Unread, rangeText, defaultText, optionText, Faults } from './fields.js';
import { Body, Field } from './form.js';

/** Most columns of a list that is shown as a grid. */
const WIDEST_GRID = 4;
/** A list longer than this is shown shortened until asked for. */
const LONG_LIST = 40;

/** A list: tick boxes for names, a line of numbers, a grid for small objects, parts for larger ones. */
export function List({ name, schema, path, value, context }) {
  const items = resolve(schema.items, context.root);
  const [whole, setWhole] = useState(false);
  // Rows that come, go, or are pasted are others: no text that was being edited stays with the wrong one.
  const [turn, setTurn] = useState(0);
  const [refusal, setRefusal] = useState(null);
  if (kindOf(items) === 'enum') return html`<${Ticks} schema=${schema} items=${items} path=${path} value=${value} context=${context} />`;
  if (kindOf(items) === 'number') return html`<${Numbers} name=${name} schema=${schema} path=${path} value=${value} context=${context} />`;
  if (kindOf(items) === 'string') return html`<${Words} name=${name} schema=${schema} path=${path} value=${value} context=${context} />`;
  const full = schema.maxItems !== undefined && value.length >= schema.maxItems;
  const add = () => {
    // A new one like the last one: supports, segments, zones come in rows.
    const last = value.at(-1);
    put([...value, last === undefined || kindOf(items) === 'choice' ? blank(items, context.root) : structuredClone(last)]);
  };
  const put = rows => {
    setTurn(turn + 1);
    setRefusal(null);
    context.set(path, rows);
  };
  const remove = index => put(value.filter((_, other) => other !== index));
  /** Rows of a spreadsheet fill the table from the cell on into which they are pasted; all of them, or none. */
  const paste = event => {
    const { column, row } = event.target.dataset.column
      ? { column: event.target.dataset.column, row: Number(event.target.closest('[data-row]').dataset.row) }
      : {};
    const cells = column && rowsOf(event.clipboardData.getData('text'));
    if (!cells) return;
    event.preventDefault();
    const found = pasted(cells, { columns: plain, from: column, row, value, items, most: schema.maxItems });
    if (found.fault) setRefusal(found);
    else put(found.rows);
  };
  const shown = whole ? value : value.slice(0, LONG_LIST);
  const fields =
    kindOf(items) === 'object'
      ? Object.entries(items.properties).map(([field, part]) => ({ name: field, schema: resolve(part, context.root) }))
      : [];
  const plain = fields.filter(field => isLeaf(field.schema));
  const isGrid =
    fields.length > 0 &&
    plain.length === fields.length &&
    fields.length <= WIDEST_GRID &&
    plain.every(field => kindOf(field.schema) === 'number');
  const label = index => `${labelOf(name, schema)} ${index + 1}`;
  return html`
    ${
      isGrid && value.length > 0
        ? html`
      <div class="grid-scroll"><table class="grid" onPaste=${paste}>
        <thead><tr>${plain.map(field => html`<th scope="col" title=${field.schema.description}>${labelOf(field.name, field.schema)}<span class="unit">${unitOf(field.schema)}</span></th>`)}<th><span class="hidden">${t('remove')}</span></th></tr></thead>
        ${shown.map((row, index) => html`<tbody key=${`${turn} ${index}`} data-row=${index}><${GridRow} ...${{ plain, items, row, context }} path=${[...path, index]} label=${label(index)} canRemove=${value.length > (schema.minItems || 0)} remove=${() => remove(index)} /></tbody>`)}
      </table></div>
      ${refusal && html`<p class="fault" role="alert"><span>${t(refusal.fault, refusal.values)}</span></p>`}`
        : shown.map(
            (item, index) => html`
      <fieldset class="item" key=${`${turn} ${index}`} id=${fieldId([...path, index])}>
        <legend><span><span class="hidden">${labelOf(name, schema)} </span>${index + 1}${kindOf(items) === 'choice' ? ` · ${variantName(variantOf(variants(items, context.root), item), context.root) ?? ''}` : ''}</span>
          <button type="button" class="icon" disabled=${value.length <= (schema.minItems || 0)} aria-label=${`${t('remove')}: ${label(index)}`} onClick=${() => remove(index)}>×</button></legend>
        <${Faults} faults=${context.errorsAt([...path, index])} id=${`${fieldId([...path, index])}-item`} names=${context.names} />
        <${Body} name=${name} schema=${items} path=${[...path, index]} value=${item} context=${context} />
      </fieldset>`,
          )
    }
    ${value.length > shown.length && html`<button type="button" class="more" onClick=${() => setWhole(true)}>${t('show_all', { count: value.length })}</button>`}
    <button type="button" class="more" disabled=${full} onClick=${add}>${t('add_item')}<span class="hidden"> ${labelOf(name, schema)}</span></button>`;
}

/** A row of a grid and what is wrong in it: below it, as wide as the grid, so that no column moves. */
function GridRow({ plain, items, path, row, label, remove, canRemove, context }) {
  const [wrong, setWrong] = useState({});
  const note = (name, fault) => setWrong(({ [name]: before, ...others }) => (fault ? { ...others, [name]: fault } : others));
  const refused = plain.flatMap(field =>
    wrong[field.name] ? [{ ...wrong[field.name], id: `${fieldId([...path, field.name])}-fault` }] : [],
  );
  return html`
    <tr>
      ${plain.map(field => html`<td key=${field.name}><${Cell} field=${field} path=${[...path, field.name]} value=${row[field.name]} required=${(items.required || []).includes(field.name)} context=${context} row=${label} onFault=${note} /></td>`)}
      <td><button type="button" class="icon" disabled=${!canRemove} aria-label=${`${t('remove')}: ${label}`} onClick=${remove}>×</button></td>
    </tr>
    ${refused.length > 0 && html`<tr class="row-faults"><td colspan=${plain.length + 1}>${refused.map(fault => html`<${Unread} key=${fault.id} ...${fault} />`)}</td></tr>`}
    <${RowFaults} plain=${plain.filter(({ name }) => !wrong[name])} ...${{ path, context }} width=${plain.length + 1} />`;
}

function RowFaults({ plain, path, context, width }) {
  const found = [
    ...context.errorsAt(path).map(fault => ({ ...fault, id: fieldId(path) })),
    ...plain.flatMap(field => context.errorsAt([...path, field.name]).map(fault => ({ ...fault, id: fieldId([...path, field.name]) }))),
  ];
  if (found.length === 0) return null;
  return html`<tr class="row-faults"><td colspan=${width}>${found.map(({ id, detail }, index) => html`<p class="fault" key=${index} id=${`${id}-fault`}>${capital(spoken(detail, context.names))}</p>`)}</td></tr>`;
}

/** A number in a grid: its name is that of row and column. */
function Cell({ field, path, value, required, context, row, onFault }) {
  const faults = context.errorsAt(path);
  const label = labelOf(field.name, field.schema);
  const id = fieldId(path);
  const [wrong, setWrong] = useState(null);
  const { draft, take, leave, key } = useNumber({
    id,
    schema: field.schema,
    value,
    required,
    set: (part, how) => context.set(path, part, how),
    onFault: fault => {
      setWrong(fault);
      onFault(field.name, fault);
    },
  });
  useEffect(() => () => onFault(field.name, null), []);
  const help = explained(context, id, {
    label,
    symbol: field.schema['x-symbol'],
    range: rangeText(field.schema),
    description: [field.schema.description, defaultText(field.schema)].join(' '),
  });
  const isFaulty = faults.length > 0 || wrong !== null;
  return html`
    <input id=${id} type="text" inputmode="decimal" autocomplete="off" data-column=${field.name} value=${draft ?? typed(value)} aria-label=${`${row}: ${label}`} onFocus=${event => event.currentTarget.select()} ...${help}
      title=${rangeText(field.schema)} placeholder=${field.schema.default !== undefined ? typed(field.schema.default) : ''} aria-invalid=${isFaulty ? 'true' : undefined} aria-describedby=${isFaulty ? `${id}-fault` : undefined}
      onInput=${event => take(event.currentTarget.value)} onBlur=${leave} onKeyDown=${key} />`;
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
  const id = fieldId(path);
  const unit = schema['x-unit'] ?? resolve(schema.items, context.root)['x-unit'];
  const list = text =>
    text
      .split(/[;\n\t]/.test(text) ? /[;\n\t]+/ : /\s+/)
      .filter(part => part.trim())
      .map(part => read(part, unit));
  const wrong = draft === null ? null : list(draft).find(({ fault }) => fault);
  useEffect(() => () => mark(id, false), [id]);
  const take = text => {
    setDraft(text);
    const next = list(text);
    const isRead = next.every(({ fault }) => !fault);
    mark(id, !isRead);
    if (isRead)
      context.set(
        path,
        next.map(one => one.value),
        'typing',
      );
  };
  // A line has no lines of its own: those of a spreadsheet become parts of the list.
  const paste = event => {
    const text = event.clipboardData.getData('text').trim();
    if (!/[\n\t]/.test(text)) return;
    event.preventDefault();
    take(text.split(/[\n\t]+/).join('; '));
  };
  return html`
    <div class="line"><input id=${id} type="text" aria-label=${`${labelOf(name, schema)} (${t('numbers_hint')})`} placeholder=${t('numbers_hint')} value=${draft ?? value.map(typed).join('; ')}
      aria-invalid=${wrong ? 'true' : undefined} aria-describedby=${wrong ? `${id}-fault` : undefined} onInput=${event => take(event.currentTarget.value)} onPaste=${paste} onBlur=${() => {
        if (!wrong) setDraft(null);
      }} />
    <span class="unit">${unitOf(schema['x-unit'] ? schema : schema.items)}</span></div>
    ${wrong && html`<${Unread} ...${wrong} choices=${null} id=${`${id}-fault`} />`}`;
}

/** Names in one line. */
function Words({ name, schema, path, value, context }) {
  const [draft, setDraft] = useState(null);
  const take = text => {
    setDraft(text);
    context.set(
      path,
      text
        .split(/[;,]+/)
        .map(word => word.trim())
        .filter(Boolean),
      'typing',
    );
  };
  return html`
    <div class="line"><input id=${fieldId(path)} type="text" aria-label=${`${labelOf(name, schema)} (${t('words_hint')})`} placeholder=${t('words_hint')} value=${draft ?? value.join('; ')}
      onInput=${event => take(event.currentTarget.value)} onBlur=${() => setDraft(null)} /></div>`;
}

/** Values by names that the schema does not know. */
export function MapFields({ name, schema, path, value, context }) {
  const [fresh, setFresh] = useState('');
  const inner = resolve(
    schema.additionalProperties && typeof schema.additionalProperties === 'object' ? schema.additionalProperties : { type: 'number' },
    context.root,
  );
  const add = () => {
    const word = fresh.trim();
    if (!word || word in value) return;
    context.set([...path, word], blank(inner, context.root));
    setFresh('');
  };
  return html`
    ${Object.entries(value).map(
      ([word, part]) => html`
      <div class="pair" key=${word}><${Field} name=${word} schema=${inner} path=${[...path, word]} value=${part} required=${true} context=${context} />
        <button type="button" class="icon" aria-label=${`${t('remove')}: ${word}`} onClick=${() => context.set([...path, word], undefined)}>×</button></div>`,
    )}
    <div class="line"><input type="text" aria-label=${`${labelOf(name, schema)}: ${t('name')}`} placeholder=${t('name')} value=${fresh} onInput=${event => setFresh(event.currentTarget.value)}
      onKeyDown=${event => {
        if (event.key === 'Enter') {
          event.preventDefault();
          add();
        }
      }} /><button type="button" onClick=${add}>${t('add')}</button></div>`;
}
