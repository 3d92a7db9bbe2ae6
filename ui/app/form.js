// A form from a schema. Nothing here knows a calculator.
import { html, useState, useEffect, useRef, useMemo, unique } from './lib.js';
import { t, typed, parsed, number, unitOf } from './text.js';
import { resolve, kindOf, variants, variantOf, variantName, blank, labelOf, wordOf, symbolParts, range, pointer, at, changed } from './schema.js';
import { TableInput } from './table-input.js';

/** Most columns of a list that is shown as a grid. */
const WIDEST_GRID = 4;
/** A list longer than this is shown shortened until asked for. */
const LONG_LIST = 40;

/** Everything that fields share: the root schema, errors by pointer, what changes, who shows help. */
class Context {
  constructor(fields) { Object.assign(this, fields); }
  /** What the service filled in where nothing was given. */
  filledAt(path) { return this.filled ? at(this.filled, path) : undefined; }
  errorsAt(path) { return this.errors.get(pointer(path)) || []; }
  /** Faults of everything below a path, and of the path itself. */
  errorsBelow(path) {
    const start = pointer(path);
    let count = 0;
    for (const [place, faults] of this.errors) if (place === start || place.startsWith(`${start}/`)) count += faults.length;
    return count;
  }
}

export const fieldId = path => `field${pointer(path).replace(/[^A-Za-z0-9_]/g, '-')}`;

/** The form of a job. `errors` are those of a problem document; `libraries` the choices of `x-library` fields. */
export function Form({ calculator, schema, value, filled, onChange, errors, libraries, models, examples, disabled }) {
  const [help, setHelp] = useState(null);
  const root = schema;
  const byPointer = useMemo(() => {
    const map = new Map();
    for (const error of errors || []) map.set(error.pointer, [...(map.get(error.pointer) || []), error]);
    return map;
  }, [errors]);
  // Models extend the jobs of one calculator: of the one whose job stands in this one, if there is such.
  const owner = typeof value.calculator === 'string' ? value.calculator : calculator;
  const context = new Context({ root, filled, errors: byPointer, libraries, models: (models || []).filter(model => model.calculator === owner), setHelp, disabled, set: (path, part, how) => onChange(changed(value, path, part), how) });
  const whole = resolve(schema, root);
  // A family of jobs, told apart by one field.
  const family = kindOf(whole) === 'choice' ? variants(whole, root) : null;
  const member = family && variantOf(family, value);
  const top = member ? member.schema : whole;
  const all = Object.entries(top.properties || {}).map(([name, part]) => ({ name, schema: resolve(part, root) })).filter(entry => kindOf(entry.schema) !== 'constant');
  const required = new Set(top.required || []);
  const isSection = ({ schema: part }) => ['object', 'choice', 'array', 'table', 'map', 'json'].includes(kindOf(part));
  const sections = all.filter(isSection);
  const loose = new Map();
  for (const entry of all.filter(entry => !isSection(entry))) {
    const group = entry.schema['x-group'] || 'settings';
    loose.set(group, [...(loose.get(group) || []), entry]);
  }
  const asked = sections.filter(({ name, schema: part }) => required.has(name) || value[name] !== undefined && !part['x-advanced']);
  const usual = sections.filter(entry => !asked.includes(entry) && entry.schema['x-table']);
  const further = sections.filter(entry => !asked.includes(entry) && !usual.includes(entry));
  const section = ({ name, schema: part }, open) => html`
    <${Section} key=${name} name=${name} schema=${part} path=${[name]} value=${value[name]} open=${open} required=${required.has(name)} context=${context} />`;
  return html`
    <form class="form" onSubmit=${event => { event.preventDefault(); onChange(value, 'run'); }} novalidate aria-label=${t('inputs')}>
      <div class="sections">
        ${member && html`<div class="family"><div class="row"><label class="label" for="family">${labelOf(member.tag, resolve(top.properties[member.tag], root))}</label>
          <span class="control wide"><select id="family" value=${family.indexOf(member)} onChange=${event => {
            const chosen = family[Number(event.currentTarget.value)];
            const example = Object.values(examples || {}).find(job => job[chosen.tag] === chosen.value);
            onChange(example || blank(chosen.schema, root));
          }}>${family.map((variant, index) => html`<option value=${index}>${variantName(variant, root)}</option>`)}</select></span></div></div>`}
        ${asked.map(entry => section(entry, true))}
        ${usual.map(entry => section(entry, false))}
        ${[...loose].map(([group, entries]) => html`
          <${Fold} key=${`group-${group}`} title=${entries[0].schema['x-group-label'] || t(`group_${group}`)} open=${true} errors=${entries.reduce((sum, { name }) => sum + context.errorsBelow([name]), 0)}>
            <${Fields} entries=${entries} path=${[]} value=${value} required=${required} context=${context} />
          <//>`)}
        ${further.length > 0 && html`<h2 class="divider">${t('further_settings')}</h2>`}
        ${further.map(entry => section(entry, false))}
      </div>
      <${Help} help=${help} />
    </form>`;
}

/** The line that says what the field under the cursor means. It keeps its height: nothing jumps. */
function Help({ help }) {
  return html`
    <div class="help" aria-hidden="true">
      ${help ? html`<p><strong>${help.label}</strong>${help.symbol && html` <${Symbol} symbol=${help.symbol} />`}${help.range && html` <span class="range">${help.range}</span>`}</p>
        <p>${help.description}</p>` : html`<p class="quiet">${t('help_hint')}</p>`}
    </div>`;
}

function Symbol({ symbol }) {
  const { base, sub } = symbolParts(symbol);
  return html`<i class="symbol">${base}${sub && html`<sub>${sub}</sub>`}</i>`;
}

/** A part that can be folded away. It opens by itself when something in it is at fault. */
function Fold({ title, note, summary, open: initially, errors, action, children, description }) {
  const [open, setOpen] = useState(initially);
  const id = useMemo(() => unique('fold'), []);
  useEffect(() => { if (errors > 0) setOpen(true); }, [errors]);
  return html`
    <section class=${`fold ${open ? 'open' : ''} ${errors > 0 ? 'faulty' : ''}`}>
      <div class="fold-head">
        <h2><button type="button" aria-expanded=${open} aria-controls=${id} onClick=${() => setOpen(!open)} title=${description}>
          <span class="chevron" aria-hidden="true"></span><span class="fold-title">${title}</span>
          ${errors > 0 && html`<span class="badge">${errors}<span class="hidden"> ${t('faults_here')}</span></span>`}
          ${!open && summary && html`<span class="summary">${summary}</span>`}
        </button></h2>
        ${open && action}
      </div>
      <div id=${id} class="fold-body" hidden=${!open}>${open && children}${open && note}</div>
    </section>`;
}

/** A top-level part of the job. */
function Section({ name, schema, path, value, open, required, context }) {
  const label = labelOf(name, schema);
  const isThere = value !== undefined && value !== null;
  const add = () => context.set(path, schema.default && Object.keys(schema.default).length ? schema.default : blank({ ...schema, optional: false }, context.root));
  const kind = kindOf(schema);
  const remove = !required && isThere && kind !== 'table' && html`
    <button type="button" class="quiet-button" onClick=${() => context.set(path, undefined)} title=${t('use_default')}>${t('reset')}<span class="hidden"> ${label}</span></button>`;
  const direct = context.errorsAt(path);
  return html`
    <${Fold} title=${label} open=${open} errors=${context.errorsBelow(path)} summary=${summary(schema, value, context.root)} action=${remove} description=${schema.description}>
      <${Faults} faults=${kind === 'table' ? [] : direct} id=${fieldId(path)} />
      ${isThere || required || kind === 'table' || (kind === 'object' && !schema.optional) || kind === 'array' || kind === 'map'
        ? html`<${Body} name=${name} schema=${schema} path=${path} value=${value} context=${context} />`
        : html`<p class="absent"><span>${schema.description}</span><button type="button" onClick=${add}>${t('add')}<span class="hidden"> ${label}</span></button></p>`}
    <//>`;
}

/** What a folded part holds, in a few words. */
function summary(schema, value, root) {
  if (value === undefined || value === null) return t('not_set');
  if (Array.isArray(value)) return value.every(part => typeof part === 'string') ? value.map(word => wordOf(schema.items && resolve(schema.items, root), word)).join(', ') : `${value.length}`;
  if (typeof value !== 'object') return String(value);
  if (value.csv) return 'CSV';
  const words = [];
  const shape = schema.properties ? schema : variantOf(variants(schema, root), value)?.schema;
  for (const [name, part] of Object.entries(value)) {
    const inner = resolve(shape?.properties?.[name] || {}, root);
    if (typeof part === 'number') {
      words.push(`${number(part, 4)} ${unitOf(inner)}`.trim());
    } else if (typeof part === 'string') words.push(inner.enum ? wordOf(inner, part).toLowerCase() : part);
    if (words.length === 3) break;
  }
  return words.join(' · ');
}

/** The inside of a part, whatever it is. */
function Body({ name, schema, path, value, context }) {
  switch (kindOf(schema)) {
    case 'object': return html`<${ObjectFields} schema=${schema} path=${path} value=${value || {}} context=${context} />`;
    case 'choice': return html`<${Choice} schema=${schema} path=${path} value=${value} context=${context} />`;
    case 'array': return html`<${List} name=${name} schema=${schema} path=${path} value=${value || []} context=${context} />`;
    case 'map': return html`<${MapFields} name=${name} schema=${schema} path=${path} value=${value || {}} context=${context} />`;
    case 'table': return html`<${TableInput} name=${name} schema=${schema} root=${context.root} value=${value}
      faults=${context.errorsAt(path)} below=${[...context.errors].filter(([place]) => place.startsWith(`${pointer(path)}/`)).flatMap(([, faults]) => faults)}
      onChange=${part => context.set(path, part)} />`;
    default: return html`<${JsonField} name=${name} schema=${schema} path=${path} value=${value} context=${context} />`;
  }
}

/** The fields of an object: the usual ones, then the rarely needed behind a button. */
function ObjectFields({ schema, path, value, context, without }) {
  const required = new Set(schema.required || []);
  const entries = Object.entries(schema.properties || {})
    .filter(([name]) => name !== without)
    .map(([name, part]) => ({ name, schema: resolve(part, context.root) }));
  return html`<${Fields} entries=${entries} path=${path} value=${value} required=${required} context=${context} />`;
}

const isLeaf = schema => ['number', 'string', 'boolean', 'enum'].includes(kindOf(schema));

function Fields({ entries, path, value, required, context }) {
  const [all, setAll] = useState(false);
  const isRare = ({ name, schema }) =>
    !required.has(name) && value[name] === undefined && (schema['x-advanced'] || !isLeaf(schema));
  const rare = entries.filter(isRare);
  // One rare field is no reason to hide it.
  const hidden = rare.length > 1 && !all && !rare.some(({ name }) => context.errorsBelow([...path, name]) > 0) ? rare : [];
  return html`
    ${entries.filter(entry => !hidden.includes(entry) && kindOf(entry.schema) !== 'constant').map(({ name, schema }) => html`
      <${Field} key=${name} name=${name} schema=${schema} path=${[...path, name]} value=${value[name]} required=${required.has(name)} context=${context} />`)}
    ${hidden.length > 0 && html`<button type="button" class="more" onClick=${() => setAll(true)}>${t('more_fields', { count: hidden.length })}</button>`}`;
}

/** One field: a row if it is a single value, a part of its own if it is more. */
function Field(props) {
  const { name, schema, path, value, required, context } = props;
  const kind = kindOf(schema);
  if (schema['x-library'] === 'materials' && context.libraries?.materials) return html`<${Row} ...${props} control=${Library} />`;
  if (name === 'model' && kind === 'string' && context.models.length + (value ? 1 : 0) > 0) return html`<${Row} ...${props} control=${ModelChoice} />`;
  if (kind === 'number') return html`<${Row} ...${props} control=${NumberInput} />`;
  if (kind === 'string') return html`<${Row} ...${props} control=${TextInput} />`;
  if (kind === 'enum') return html`<${Row} ...${props} control=${Enum} />`;
  if (kind === 'boolean') return html`<${Row} ...${props} control=${Switch} />`;
  const label = labelOf(name, schema);
  const isThere = value !== undefined && value !== null;
  const set = part => context.set(path, part);
  return html`
    <fieldset class="part" id=${fieldId(path)}>
      <legend>${label}
        ${isThere && !required && html`<button type="button" class="quiet-button" onClick=${() => set(undefined)}>${t('remove')}<span class="hidden"> ${label}</span></button>`}
      </legend>
      <${Faults} faults=${context.errorsAt(path)} id=${`${fieldId(path)}-part`} />
      ${isThere || required || kind === 'array'
        ? html`<${Body} name=${name} schema=${schema} path=${path} value=${value} context=${context} />`
        : html`<p class="absent"><span>${schema.description}</span><button type="button" onClick=${() => set(blank({ ...schema, optional: false }, context.root))}>${t('add')}<span class="hidden"> ${label}</span></button></p>`}
    </fieldset>`;
}

function rangeText(schema) {
  const { low, high, openLow, openHigh } = range(schema);
  const unit = unitOf(schema);
  const tail = unit ? ` ${unit}` : '';
  if (low !== undefined && high !== undefined) return `${openLow ? '>' : ''}${number(low)} … ${openHigh ? '<' : ''}${number(high)}${tail}`;
  if (low !== undefined) return `${openLow ? '>' : '≥'} ${number(low)}${tail}`;
  if (high !== undefined) return `${openHigh ? '<' : '≤'} ${number(high)}${tail}`;
  return '';
}

const defaultText = schema => {
  if (schema.default === undefined || schema.default === null || typeof schema.default === 'object') return '';
  return t('default_is', { value: typeof schema.default === 'number' ? number(schema.default) : schema.default === true ? t('yes') : schema.default === false ? t('no') : wordOf(schema, schema.default) });
};

/** Label, control, unit, and the words of the service where the value is at fault. */
function Row({ name, schema, path, value, required, context, control: Control, compact }) {
  const id = fieldId(path);
  const label = labelOf(name, schema);
  const faults = context.errorsAt(path);
  const description = [schema.description, defaultText(schema)].filter(Boolean).join(' ');
  const allowed = kindOf(schema) === 'number' ? rangeText(schema) : '';
  const show = () => context.setHelp({ label, symbol: schema['x-symbol'], range: allowed, description });
  const [wrong, setWrong] = useState(null);
  const unit = unitOf(schema);
  const common = {
    id, schema, value, context, label,
    set: (part, how) => context.set(path, part, how),
    setWrong,
    filled: context.filledAt(path),
    described: `${id}-about${faults.length || wrong ? ` ${id}-fault` : ''}`,
    invalid: faults.length > 0 || wrong !== null,
    required,
  };
  return html`
    <div class=${`row ${faults.length || wrong ? 'faulty' : ''} ${compact ? 'compact' : ''}`} onMouseEnter=${show} onFocusIn=${show}>
      <${Control} ...${common} label=${html`<span>${label}</span>${schema['x-symbol'] && schema['x-symbol'].toLowerCase() !== label.toLowerCase() && html` <${Symbol} symbol=${schema['x-symbol']} />`}`} unit=${unit} plain=${label} />
      <span id=${`${id}-about`} class="hidden">${[unit && t('in_unit', { unit }), allowed, description].filter(Boolean).join('. ')}</span>
      <${Faults} faults=${wrong ? [{ detail: wrong }] : faults} id=${`${id}-fault`} />
    </div>`;
}

function Faults({ faults, id }) {
  if (!faults || faults.length === 0) return null;
  return html`<p class="fault" id=${id}>${faults.map(fault => html`<span>${sentence(fault.detail)}</span>`)}</p>`;
}

/** Names of fields keep their small letters. */
const sentence = text => (!text || /^[a-z]+_/.test(text) ? text : text.charAt(0).toUpperCase() + text.slice(1));

/** Steps of the arrow keys: a hundredth of the value's size, a tenth with shift. */
function nudged(value, schema, direction, shift) {
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

function NumberInput({ id, schema, value, filled, set, setWrong, described, invalid, label, unit, required, context }) {
  const [draft, setDraft] = useState(null);
  const [isFocused, setFocused] = useState(false);
  // The value may change under a draft: by the way back, by a click in the picture.
  useEffect(() => {
    const read = draft === null ? null : parsed(draft);
    if (draft !== null && !Number.isNaN(read) && !Object.is(read ?? undefined, value)) setDraft(null);
  }, [value]);
  // All digits only while they may be edited.
  const shown = draft ?? (isFocused || typeof value !== 'number' ? typed(value) : typed(Number(value.toPrecision(7))));
  const take = text => {
    setDraft(text);
    const read = parsed(text);
    if (Number.isNaN(read)) setWrong(t('not_a_number'));
    else if (read === null && required) setWrong(t('needed'));
    else if (read !== null && schema.type === 'integer' && !Number.isInteger(read)) setWrong(t('not_whole'));
    else {
      setWrong(null);
      if (!Object.is(read ?? undefined, value)) set(read === null ? undefined : read, 'typing');
    }
  };
  const leave = () => {
    setFocused(false);
    if (draft !== null && !Number.isNaN(parsed(draft)) && !(parsed(draft) === null && required)) setDraft(null);
  };
  const key = event => {
    if (event.key !== 'ArrowUp' && event.key !== 'ArrowDown') return;
    event.preventDefault();
    setDraft(null);
    setWrong(null);
    set(nudged(value, schema, event.key === 'ArrowUp' ? 1 : -1, event.shiftKey), 'typing');
  };
  const drag = useDrag(value, schema, next => { setDraft(null); setWrong(null); set(next, 'typing'); });
  const standIn = typeof filled === 'number' ? filled : schema.default;
  const placeholder = standIn === undefined || standIn === null ? '' : typed(Number(standIn.toPrecision(7)));
  return html`
    <label for=${id} class="label draggable" ...${drag}>${label}</label>
    <span class="control"><input id=${id} type="text" inputmode="decimal" autocomplete="off" spellcheck=${false} value=${shown} placeholder=${placeholder}
      disabled=${context.disabled} aria-describedby=${described} aria-invalid=${invalid ? 'true' : undefined} aria-required=${required ? 'true' : undefined}
      onInput=${event => take(event.currentTarget.value)} onBlur=${leave} onKeyDown=${key} onFocus=${event => { const field = event.currentTarget; setFocused(true); setTimeout(() => { if (document.activeElement === field) field.select(); }, 0); }} /></span>
    <span class="unit" aria-hidden="true">${unit}</span>`;
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
    onPointerUp: () => { start.current = start.current?.moved ? { done: true } : null; if (start.current) setTimeout(() => { start.current = null; }, 0); },
    onClick: event => { if (start.current?.done) event.preventDefault(); },
  };
}

function TextInput({ id, value, schema, set, described, invalid, label, required, context }) {
  return html`
    <label for=${id} class="label">${label}</label>
    <span class="control wide"><input id=${id} type="text" autocomplete="off" value=${value ?? ''} placeholder=${schema.default ?? ''} disabled=${context.disabled}
      aria-describedby=${described} aria-invalid=${invalid ? 'true' : undefined} aria-required=${required ? 'true' : undefined}
      onChange=${event => set(event.currentTarget.value === '' && !required ? undefined : event.currentTarget.value)} /></span>`;
}

/** The service's words for the values of an enumeration, where it has any. */
const optionText = (schema, value) => wordOf(schema, value);

function Enum({ id, schema, value, set, described, invalid, label, required, context }) {
  const fallback = schema.default;
  return html`
    <label for=${id} class="label">${label}</label>
    <span class="control wide"><select id=${id} disabled=${context.disabled} aria-describedby=${described} aria-invalid=${invalid ? 'true' : undefined}
      value=${value ?? fallback ?? ''} onChange=${event => set(event.currentTarget.value === '' ? undefined : event.currentTarget.value)}>
      ${!required && fallback === undefined && html`<option value="">${t('not_set')}</option>`}
      ${schema.enum.filter(option => option !== null).map(option => html`<option value=${option}>${optionText(schema, option)}</option>`)}
    </select></span>`;
}

function Switch({ id, schema, value, set, described, label, context }) {
  return html`
    <label for=${id} class="label">${label}</label>
    <span class="control"><input id=${id} type="checkbox" role="switch" disabled=${context.disabled} checked=${value ?? schema.default ?? false} aria-describedby=${described}
      onChange=${event => set(event.currentTarget.checked)} /></span>`;
}

function Library({ id, value, set, described, invalid, label, context }) {
  return html`
    <label for=${id} class="label">${label}</label>
    <span class="control wide"><select id=${id} value=${value ?? ''} aria-describedby=${described} aria-invalid=${invalid ? 'true' : undefined}
      onChange=${event => set(event.currentTarget.value || undefined)}>
      <option value="">${t('not_set')}</option>
      ${context.libraries.materials.map(({ id: name, title }) => html`<option value=${name}>${title}</option>`)}
    </select></span>`;
}

function ModelChoice({ id, value, set, described, invalid, label, context }) {
  return html`
    <label for=${id} class="label">${label}</label>
    <span class="control wide"><select id=${id} value=${value ?? ''} aria-describedby=${described} aria-invalid=${invalid ? 'true' : undefined}
      onChange=${event => set(event.currentTarget.value || undefined)}>
      <option value="">${t('no_model')}</option>
      ${value && !context.models.some(({ name }) => name === value) && html`<option value=${value}>${value}</option>`}
      ${context.models.map(({ name }) => html`<option value=${name}>${name}</option>`)}
    </select></span>`;
}

/** One of several kinds, each with fields of its own. */
function Choice({ schema, path, value, context }) {
  const list = variants(schema, context.root);
  const now = variantOf(list, value);
  const id = `${fieldId(path)}-kind`;
  const pick = event => {
    const chosen = list[Number(event.currentTarget.value)];
    const fresh = blank(chosen.schema, context.root);
    // What both kinds have in common stays.
    if (value && typeof value === 'object' && !Array.isArray(value) && fresh && typeof fresh === 'object') {
      for (const name of Object.keys(fresh)) {
        if (name !== chosen.tag && typeof value[name] === typeof fresh[name] && typeof value[name] !== 'object') fresh[name] = value[name];
      }
    }
    context.set(path, fresh);
  };
  const name = variant => variantName(variant, context.root) ?? t(`form_${kindOf(variant.schema)}`);
  const show = () => context.setHelp({ label: name(now), description: now.schema.description });
  return html`
    <div class="row" onMouseEnter=${show} onFocusIn=${show}>
      <label for=${id} class="label">${t('kind')}</label>
      <span class="control wide"><select id=${id} value=${list.indexOf(now)} onChange=${pick}>
        ${list.map((variant, index) => html`<option value=${index}>${name(variant)}</option>`)}
      </select></span>
    </div>
    ${kindOf(now.schema) === 'object'
      ? html`<${ObjectFields} schema=${now.schema} path=${path} value=${value || {}} context=${context} without=${now.tag} />`
      : html`<${Field} name=${path.at(-1)} schema=${now.schema} path=${path} value=${value} required=${true} context=${context} />`}`;
}

/** A list: tick boxes for names, a line of numbers, a grid for small objects, parts for larger ones. */
function List({ name, schema, path, value, context }) {
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
        <tbody>${shown.map((row, index) => html`<tr key=${index}>
          ${plain.map(field => html`<td><${Cell} field=${field} path=${[...path, index, field.name]} value=${row[field.name]} required=${(items.required || []).includes(field.name)} context=${context} row=${label(index)} /></td>`)}
          <td><button type="button" class="icon" disabled=${value.length <= (schema.minItems || 0)} aria-label=${`${t('remove')}: ${label(index)}`} onClick=${() => remove(index)}>×</button></td>
        </tr>`)}</tbody>
      </table></div>`
    : shown.map((item, index) => html`
      <fieldset class="item" key=${index} id=${fieldId([...path, index])}>
        <legend><span><span class="hidden">${labelOf(name, schema)} </span>${index + 1}${kindOf(items) === 'choice' ? ` · ${variantName(variantOf(variants(items, context.root), item), context.root) ?? ''}` : ''}</span>
          <button type="button" class="icon" disabled=${value.length <= (schema.minItems || 0)} aria-label=${`${t('remove')}: ${label(index)}`} onClick=${() => remove(index)}>×</button></legend>
        <${Faults} faults=${context.errorsAt([...path, index])} id=${`${fieldId([...path, index])}-item`} />
        <${Body} name=${name} schema=${items} path=${[...path, index]} value=${item} context=${context} />
      </fieldset>`)}
    ${value.length > shown.length && html`<button type="button" class="more" onClick=${() => setWhole(true)}>${t('show_all', { count: value.length })}</button>`}
    <button type="button" class="more" disabled=${full} onClick=${add}>${t('add_item')}<span class="hidden"> ${labelOf(name, schema)}</span></button>`;
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
      placeholder=${field.schema.default !== undefined ? typed(field.schema.default) : ''} aria-invalid=${faults.length || wrong ? 'true' : undefined} aria-describedby=${faults.length ? `${id}-fault` : undefined}
      onInput=${event => take(event.currentTarget.value)} onBlur=${() => { if (!wrong) setDraft(null); }} onKeyDown=${key} />
    <${Faults} faults=${faults} id=${`${id}-fault`} />`;
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
function MapFields({ name, schema, path, value, context }) {
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

/** What no other field can show. */
function JsonField({ name, schema, path, value, context }) {
  const [draft, setDraft] = useState(null);
  const [wrong, setWrong] = useState(false);
  const take = text => {
    setDraft(text);
    try {
      context.set(path, text.trim() === '' ? undefined : JSON.parse(text));
      setWrong(false);
    } catch { setWrong(true); }
  };
  return html`<textarea id=${fieldId(path)} rows="4" class="json" spellcheck=${false} aria-label=${labelOf(name, schema)} aria-invalid=${wrong ? 'true' : undefined}
    value=${draft ?? (value === undefined ? '' : JSON.stringify(value, null, 1))} onInput=${event => take(event.currentTarget.value)}></textarea>`;
}

/** Moves the cursor to the field of a fault, or to the nearest part that is shown. */
export function goTo(place) {
  const path = place.split('/').slice(1);
  for (let length = path.length; length > 0; length -= 1) {
    const element = document.getElementById(fieldId(path.slice(0, length)));
    if (element) {
      element.scrollIntoView({ block: 'center' });
      (element.matches('input,select,textarea,button') ? element : element.querySelector('input,select,textarea,button'))?.focus();
      return;
    }
  }
}
