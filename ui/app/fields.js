// Fields of a single value: label, control, unit, and the words of the service where the value is at fault.
import { html, useState, useEffect, useRef, cell } from './lib.js';
import { t, capital, typed, number, unitOf } from './text.js';
import { read } from './number.js';
import { Origin } from './records.js';
import { kindOf, labelOf, wordOf, symbolParts, range, pointer, spoken } from './schema.js';

/** A unit of more letters is written smaller rather than broken. */
const LONG_UNIT = 7;

export const fieldId = path => `field${pointer(path).replace(/[^A-Za-z0-9_]/g, '-')}`;

/** The fields of the form whose text is no value, by their ids: what is computed without them is not what is typed. */
export const unread = cell(new Set());
export function mark(id, isUnread) {
  if (unread.get().has(id) === isUnread) return;
  const ids = new Set(unread.get());
  if (isUnread) ids.add(id);
  else ids.delete(id);
  unread.set(ids);
}

/** Whether one control is enough for it. */
export const isLeaf = schema => ['number', 'string', 'boolean', 'enum'].includes(kindOf(schema));

export function FieldSymbol({ symbol }) {
  const { base, sub } = symbolParts(symbol);
  return html`<i class="symbol">${base}${sub && html`<sub>${sub}</sub>`}</i>`;
}

export function rangeText(schema) {
  const { low, high, openLow, openHigh } = range(schema);
  const unit = unitOf(schema);
  const tail = unit ? ` ${unit}` : '';
  if (low !== undefined && high !== undefined) return `${openLow ? '>' : ''}${number(low)} … ${openHigh ? '<' : ''}${number(high)}${tail}`;
  if (low !== undefined) return `${openLow ? '>' : '≥'} ${number(low)}${tail}`;
  if (high !== undefined) return `${openHigh ? '<' : '≤'} ${number(high)}${tail}`;
  return '';
}

export const defaultText = schema => {
  if (schema.default === undefined || schema.default === null || typeof schema.default === 'object') return '';
  return t('default_is', {
    value:
      typeof schema.default === 'number'
        ? number(schema.default)
        : schema.default === true
          ? t('yes')
          : schema.default === false
            ? t('no')
            : wordOf(schema, schema.default),
  });
};

/** What shows its meaning while it is pointed at, and while it is edited. */
export function explained(context, id, help) {
  context.helps.set(id, help);
  return {
    onMouseEnter: () => context.pointAt(id),
    onMouseLeave: () => context.pointAt(null),
    onFocusIn: () => {
      context.pointAt(null);
      context.focusOn(id);
    },
  };
}

/** Label, control, unit, and the words of the service where the value is at fault. */
export function Row({ name, schema, path, value, required, context, control: Control, compact }) {
  const id = fieldId(path);
  const label = labelOf(name, schema);
  const faults = context.errorsAt(path);
  const filled = value === undefined ? context.filledAt(path) : undefined;
  const own = defaultText(schema);
  // A number that the service takes from elsewhere says from where.
  const from =
    typeof filled === 'number' && filled !== schema.default
      ? `${number(filled)} ${unitOf(schema)}: ${context.sourceAt(path)}`.replace(/ +:/, ':')
      : '';
  const description = spoken([schema.description, own, from].filter(Boolean).join(' '), context.names);
  const allowed = kindOf(schema) === 'number' ? rangeText(schema) : '';
  const origin = value === undefined ? context.originAt(path) : undefined;
  const [isAsked, setAsked] = useState(false);
  // Codes: they are worded anew in each language.
  const [wrong, setWrong] = useState(null);
  const unit = unitOf(schema);
  const common = {
    id,
    path,
    schema,
    value,
    context,
    label,
    set: (part, how) => context.set(path, part, how),
    setWrong,
    filled: context.filledAt(path),
    described: `${id}-about${faults.length || wrong ? ` ${id}-fault` : ''}`,
    invalid: faults.length > 0 || wrong !== null,
    required,
  };
  return html`
    <div class=${`row ${faults.length || wrong ? 'faulty' : ''} ${compact ? 'compact' : ''}`} ...${explained(context, id, { label, symbol: schema['x-symbol'], range: allowed, description })}>
      ${origin && html`<button type="button" class="origin-mark" aria-expanded=${isAsked ? 'true' : 'false'} title=${t('where_from')} aria-label=${`${t('where_from')} ${label}`} onClick=${() => setAsked(!isAsked)}>◦</button>`}
      <${Control} ...${common} label=${html`<span>${label}</span>${schema['x-symbol'] && schema['x-symbol'].toLowerCase() !== label.toLowerCase() && html`\u00a0<${FieldSymbol} symbol=${schema['x-symbol']} />`}`} unit=${unit} plain=${label} />
      <span id=${`${id}-about`} class="hidden">${[unit && t('in_unit', { unit }), allowed, description].filter(Boolean).join('. ')}</span>
      ${origin && isAsked && html`<${Origin} origin=${origin} resources=${context.resources} libraries=${context.libraries} unit=${unit} />`}
      ${wrong ? html`<${Unread} ...${wrong} id=${`${id}-fault`} />` : html`<${Faults} faults=${faults} id=${`${id}-fault`} names=${context.names} />`}
    </div>`;
}

/** Why a text is no value; what it may mean is offered. */
export function Unread({ fault, values, choices, choose, id }) {
  return html`<p class="fault" id=${id}><span>${t(fault, values)}</span>${choices && html`<span class="choices">${choices.map(value => html`<button type="button" key=${value} onClick=${() => choose(value)}>${number(value, 12)}</button>`)}</span>`}</p>`;
}

export function Faults({ faults, id, names }) {
  if (!faults || faults.length === 0) return null;
  return html`<p class="fault" id=${id}>${faults.map(fault => html`<span>${capital(spoken(fault.detail, names))}</span>`)}</p>`;
}

/** Steps of the arrow keys: one in the second significant digit, with shift in the first; whole numbers by 1 or 10. */
export function nudged(value, schema, direction, shift) {
  const { low, high } = range(schema);
  if (schema.type === 'integer') {
    const step = shift ? 10 : 1;
    return Math.min(Math.max((value ?? schema.default ?? low ?? 0) + direction * step, low ?? -Infinity), high ?? Infinity);
  }
  const from = value ?? schema.default ?? schema.example ?? 0;
  const size = from === 0 ? Math.abs(schema.example || 1) : Math.abs(from);
  const step = 10 ** (Math.floor(Math.log10(size)) - (shift ? 0 : 1));
  const next = Number((from + direction * step).toPrecision(12));
  return Math.min(Math.max(next, low ?? -Infinity), high ?? Infinity);
}

/** Why a text is no value of the field, or `{ value }`. */
export function readField(text, schema, required) {
  const found = read(text, schema['x-unit']);
  if (found.fault) return found;
  if (found.value === null) return required ? { fault: 'needed' } : found;
  return schema.type === 'integer' && !Number.isInteger(found.value) ? { fault: 'not_whole' } : found;
}

/** The text of a number while it is edited, in a row of the form or a cell of a table. Until it is a value the field is
 *  marked: nothing that is shown is an answer to it. */
export function useNumber({ id, schema, value, required, set, onFault }) {
  const [draft, setDraft] = useState(null);
  const wrong = useRef(null);
  const say = fault => {
    wrong.current = fault;
    mark(id, fault !== null);
    onFault(fault);
  };
  const drop = () => {
    setDraft(null);
    if (wrong.current) say(null);
  };
  const put = next => {
    drop();
    if (!Object.is(next, value)) set(next, 'typing');
  };
  useEffect(() => () => mark(id, false), [id]);
  // The value may change under a draft: by the way back, by a click in the picture.
  useEffect(() => {
    if (draft === null || Object.is(readField(draft, schema, required).value ?? undefined, value)) return;
    drop();
  }, [value]);
  return {
    draft,
    take: text => {
      setDraft(text);
      const found = readField(text, schema, required);
      say(found.fault ? { ...found, choose: put } : null);
      if (!found.fault && !Object.is(found.value ?? undefined, value)) set(found.value ?? undefined, 'typing');
    },
    leave: () => {
      if (!wrong.current) setDraft(null);
    },
    put,
    key: event => {
      if (event.key !== 'ArrowUp' && event.key !== 'ArrowDown') return;
      event.preventDefault();
      put(nudged(value, schema, event.key === 'ArrowUp' ? 1 : -1, event.shiftKey));
    },
  };
}

export function NumberInput({ id, schema, value, filled, set, setWrong, described, invalid, label, unit, required, context }) {
  const [isFocused, setFocused] = useState(false);
  const { draft, take, leave, put, key } = useNumber({ id, schema, value, required, set, onFault: setWrong });
  // All digits only while they may be edited.
  const shown = draft ?? (isFocused || typeof value !== 'number' ? typed(value) : typed(Number(value.toPrecision(7))));
  const drag = useDrag(value, schema, put);
  const standIn = typeof filled === 'number' ? filled : schema.default;
  const placeholder = standIn === undefined || standIn === null ? '' : typed(Number(standIn.toPrecision(7)));
  return html`
    <label for=${id} class="label draggable" ...${drag}>${label}</label>
    <span class="control"><input id=${id} type="text" inputmode="decimal" autocomplete="off" spellcheck=${false} value=${shown} placeholder=${placeholder} title=${rangeText(schema)}
      disabled=${context.disabled} aria-describedby=${described} aria-invalid=${invalid ? 'true' : undefined} aria-required=${required ? 'true' : undefined}
      onInput=${event => take(event.currentTarget.value)} onBlur=${() => {
        setFocused(false);
        leave();
      }} onKeyDown=${key} onFocus=${event => {
        const field = event.currentTarget;
        setFocused(true);
        setTimeout(() => {
          if (document.activeElement === field) field.select();
        }, 0);
      }} /></span>
    <span class=${`unit ${unit.length > LONG_UNIT ? 'long' : ''}`} aria-hidden="true">${unit}</span>`;
}

/** A number dragged by its label: 60 px double it. */
function useDrag(value, schema, set) {
  const start = useRef(null);
  const { low, high } = range(schema);
  return {
    onPointerDown: event => {
      if (event.button !== 0 || event.pointerType === 'touch') return;
      start.current = { x: event.clientX, value: value ?? schema.default ?? schema.example ?? 0, moved: false };
      event.currentTarget.setPointerCapture(event.pointerId);
    },
    onPointerMove: event => {
      if (!start.current) return;
      const dx = event.clientX - start.current.x;
      if (!start.current.moved && Math.abs(dx) < 4) return;
      start.current.moved = true;
      const from = start.current.value;
      const raw = from === 0 ? (dx / 60) * Math.abs(schema.example || 1) : from * 2 ** ((Math.sign(from) * dx) / 60);
      const limited = Math.min(Math.max(raw, low ?? -Infinity), high ?? Infinity);
      set(schema.type === 'integer' ? Math.round(limited) : Number(limited.toPrecision(3)));
    },
    onPointerUp: () => {
      start.current = start.current?.moved ? { done: true } : null;
      if (start.current)
        setTimeout(() => {
          start.current = null;
        }, 0);
    },
    onClick: event => {
      if (start.current?.done) event.preventDefault();
    },
  };
}

export function TextInput({ id, value, schema, set, described, invalid, label, required, context }) {
  const take = event => set(event.currentTarget.value === '' && !required ? undefined : event.currentTarget.value, 'typing');
  return html`
    <label for=${id} class="label">${label}</label>
    <span class="control wide">${context.names?.has(value) && html`<span class="called">${context.names.get(value)}</span>`}<input id=${id} type="text" autocomplete="off" value=${value ?? ''} placeholder=${schema.default ?? ''} disabled=${context.disabled}
      aria-describedby=${described} aria-invalid=${invalid ? 'true' : undefined} aria-required=${required ? 'true' : undefined} onInput=${take} /></span>`;
}

/** The service's words for the values of an enumeration, where it has any. */
export const optionText = (schema, value) => wordOf(schema, value);

export function Enum({ id, schema, value, set, described, invalid, label, required, context }) {
  const fallback = schema.default;
  return html`
    <label for=${id} class="label">${label}</label>
    <span class="control wide"><select id=${id} disabled=${context.disabled} aria-describedby=${described} aria-invalid=${invalid ? 'true' : undefined}
      value=${value ?? fallback ?? ''} onChange=${event => set(event.currentTarget.value === '' ? undefined : event.currentTarget.value)}>
      ${!required && fallback === undefined && html`<option value="">${t('not_set')}</option>`}
      ${schema.enum.filter(option => option !== null).map(option => html`<option value=${option}>${optionText(schema, option)}</option>`)}
    </select></span>`;
}

export function Switch({ id, schema, value, set, described, label, context }) {
  return html`
    <label for=${id} class="label">${label}</label>
    <span class="control"><input id=${id} type="checkbox" role="switch" disabled=${context.disabled} checked=${value ?? schema.default ?? false} aria-describedby=${described}
      onChange=${event => set(event.currentTarget.checked)} /></span>`;
}

export function Library({ id, value, set, described, invalid, label, context }) {
  return html`
    <label for=${id} class="label">${label}</label>
    <span class="control wide"><select id=${id} value=${value ?? ''} aria-describedby=${described} aria-invalid=${invalid ? 'true' : undefined}
      onChange=${event => set(event.currentTarget.value || undefined)}>
      <option value="">${t('not_set')}</option>
      ${context.libraries.materials.map(({ id: name, title }) => html`<option value=${name}>${title}</option>`)}
    </select></span>`;
}

export function ModelChoice({ id, value, set, described, invalid, label, context }) {
  return html`
    <label for=${id} class="label">${label}</label>
    <span class="control wide"><select id=${id} value=${value ?? ''} aria-describedby=${described} aria-invalid=${invalid ? 'true' : undefined}
      onChange=${event => set(event.currentTarget.value || undefined)}>
      <option value="">${t('no_model')}</option>
      ${value && !context.models.some(({ name }) => name === value) && html`<option value=${value}>${value}</option>`}
      ${context.models.map(({ name }) => html`<option value=${name}>${name}</option>`)}
    </select></span>`;
}
