// A form from a schema. Nothing here knows a calculator.
import { html, useState, useEffect, useMemo, unique } from './lib.js';
import { t, number, unitOf } from './text.js';
import {
  resolve,
  namesOf,
  kindOf,
  variants,
  variantOf,
  memberOf,
  variantName,
  blank,
  kept,
  labelOf,
  wordOf,
  spoken,
  pointer,
  at,
  changed,
} from './schema.js';
import { runsOf } from './table-file.js';
import {
  fieldId,
  isLeaf,
  mark,
  explained,
  FieldSymbol,
  Faults,
  Row,
  NumberInput,
  TextInput,
  Enum,
  Switch,
  Library,
  ModelChoice,
} from './fields.js';
import { List, MapFields } from './lists.js';
import { TableInput } from './table-input.js';
import { TextFile } from './text-file.js';
import { forget, isSame, keep, ownName, useKept } from './mine.js';
import { Records } from './records.js';
import { withFollowers } from './follow.js';

/** Everything that fields share: the root schema, errors by pointer, what changes, who shows help. */
class Context {
  /** @param {any} fields */
  constructor(fields) {
    Object.assign(this, fields);
    this.value = fields.value;
    this.filled = fields.filled;
    this.resources = fields.resources;
    /** @type {Map<string, any> | undefined} */
    this.origins = fields.origins;
    this.libraries = fields.libraries;
    /** @type {Map<string, any[]>} */
    this.errors = fields.errors;
    /** @type {Map<string, any>} What each field of this form means now, by its id. */
    this.helps = new Map();
  }
  /** What the service filled in where nothing was given. */
  filledAt(path) {
    return this.filled ? at(this.filled, path) : undefined;
  }
  /** Where it comes from, if a machine, a tool or a material fills it in. */
  originAt(path) {
    return this.origins?.get(pointer(path));
  }
  /** Where that comes from: the source of the material that is named beside it, or the service. */
  sourceAt(path) {
    const beside = at(this.value, path.slice(0, -1)) || {};
    const material = this.libraries?.materials?.find(({ id }) => Object.values(beside).includes(id));
    const entry = material?.[path.at(-1)];
    return entry?.source ? t('from_material', { name: material.title, source: entry.source }) : t('filled_in');
  }
  errorsAt(path) {
    return this.errors.get(pointer(path)) || [];
  }
  /** Faults of everything below a path, and of the path itself. */
  errorsBelow(path) {
    const start = pointer(path);
    let count = 0;
    for (const [place, faults] of this.errors) if (place === start || place.startsWith(`${start}/`)) count += faults.length;
    return count;
  }
}

/** The form of a job. `errors` are those of a problem document; `libraries` the records that it may name, by what they are:
 *  `records`, and the choices of `x-library` fields; `said` is the answer to it. */
export function Form({ calculator, schema, value, said, onChange, errors, libraries, records = [], models, examples, disabled }) {
  // What is under the hand is explained, otherwise the field that is being edited.
  const [pointed, setPointed] = useState(null);
  const [focused, setFocused] = useState(null);
  const root = schema;
  const byPointer = useMemo(() => {
    const map = new Map();
    for (const error of errors || []) map.set(error.pointer, [...(map.get(error.pointer) || []), error]);
    return map;
  }, [errors]);
  // Models extend the jobs of one calculator: of the one whose job stands in this one, if there is such.
  const owner = typeof value.calculator === 'string' ? value.calculator : calculator;
  const origins = useMemo(() => new Map((said?.origins || []).map(origin => [origin.pointer, origin])), [said]);
  const context = new Context({
    root,
    value,
    names: namesOf(root),
    filled: said?.input,
    origins,
    resources: said?.resources,
    errors: byPointer,
    libraries,
    models: (models || []).filter(model => model.calculator === owner),
    pointAt: setPointed,
    focusOn: setFocused,
    disabled,
    set: (path, part, how) => onChange(withFollowers(root, value, changed(value, path, part)), how),
  });
  const whole = resolve(schema, root);
  // A family of jobs, told apart by one field.
  const family = kindOf(whole) === 'choice' ? variants(whole, root) : null;
  const member = family && variantOf(family, value);
  const top = member ? member.schema : whole;
  const all = Object.entries(top.properties || {})
    .map(([name, part]) => ({ name, schema: resolve(part, root), own: ownName(name, part, root) }))
    .filter(entry => kindOf(entry.schema) !== 'constant');
  // Where a name stands in place of an object of the calculator's own, the picker shows it.
  const isNamed = ({ name }) => records.includes(name) && typeof value[name] === 'string';
  const required = new Set(top.required || []);
  const isSection = ({ schema: part }) => ['object', 'choice', 'array', 'table', 'map', 'json'].includes(kindOf(part));
  const sections = all.filter(entry => isSection(entry) && !isNamed(entry));
  const loose = new Map();
  for (const entry of all.filter(entry => !isSection(entry))) {
    const group = entry.schema['x-group'] || 'settings';
    loose.set(group, [...(loose.get(group) || []), entry]);
  }
  const asked = sections.filter(({ name, schema: part }) => required.has(name) || (value[name] !== undefined && !part['x-advanced']));
  // What was measured comes first where nothing can be said without it.
  asked.sort(
    (a, b) => Number(Boolean(b.schema['x-table'] && required.has(b.name))) - Number(Boolean(a.schema['x-table'] && required.has(a.name))),
  );
  const usual = sections.filter(entry => !asked.includes(entry) && entry.schema['x-table']);
  const further = sections.filter(entry => !asked.includes(entry) && !usual.includes(entry));
  const section = ({ name, schema: part, own }, open) => html`
    <${Section} key=${name} name=${name} own=${own} schema=${part} path=${[name]} value=${value[name]} open=${open} required=${required.has(name)} context=${context} />`;
  return html`
    <form class="form" onSubmit=${event => {
      event.preventDefault();
      onChange(value, 'run');
    }} novalidate aria-label=${t('inputs')}>
      <div class="sections">
        ${records.length > 0 && html`<${Records} kinds=${records} declared=${all.map(({ name }) => name)} value=${value} onChange=${onChange} libraries=${libraries} said=${said} context=${context} />`}
        ${
          member &&
          html`<div class="family"><div class="row"><label class="label" for="family">${labelOf(member.tag, resolve(top.properties[member.tag], root))}</label>
          <span class="control wide"><select id="family" value=${family.indexOf(member)} onChange=${event => {
            const chosen = family[Number(event.currentTarget.value)];
            const example = Object.values(examples || {}).find(job => job[chosen.tag] === chosen.value);
            onChange(example || blank(chosen.schema, root));
          }}>${family.map((variant, index) => html`<option value=${index}>${variantName(variant, root)}</option>`)}</select></span></div></div>`
        }
        ${asked.map(entry => section(entry, true))}
        ${usual.map(entry => section(entry, false))}
        ${[...loose].map(
          ([group, entries]) => html`
          <${Fold} key=${`group-${group}`} title=${entries[0].schema['x-group-label'] || t(`group_${group}`)} open=${true} errors=${entries.reduce((sum, { name }) => sum + context.errorsBelow([name]), 0)}>
            <${Fields} entries=${entries} path=${[]} value=${value} required=${required} context=${context} />
          <//>`,
        )}
        ${further.length > 0 && html`<h2 class="divider">${t('further_settings')}</h2>`}
        ${further.map(entry => section(entry, false))}
      </div>
      <${Help} of=${pointed ?? focused} helps=${context.helps} />
    </form>`;
}

/** The line that says what the field under the cursor means. It keeps its height: nothing jumps. */
function Help({ of, helps }) {
  const help = helps.get(of);
  return html`
    <div class="help" aria-hidden="true">
      ${
        help
          ? html`<p><strong>${help.label}</strong>${help.symbol && html` <${FieldSymbol} symbol=${help.symbol} />`}${help.range && html` <span class="range">${help.range}</span>`}</p>
        <p>${help.description}</p>`
          : html`<p class="quiet">${t(matchMedia('(pointer: coarse)').matches ? 'help_hint_touch' : 'help_hint')}</p>`
      }
    </div>`;
}

/** A part that can be folded away. It opens by itself when something in it is at fault. */
function Fold({ title, note, summary, open: initially, errors, action, children, description }) {
  const [open, setOpen] = useState(initially);
  const id = useMemo(() => unique('fold'), []);
  useEffect(() => {
    if (errors > 0) setOpen(true);
  }, [errors]);
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
function Section({ name, own, schema, path, value, open, required, context }) {
  const label = labelOf(name, schema);
  const isThere = value !== undefined && value !== null;
  const add = () =>
    context.set(
      path,
      schema.default && Object.keys(schema.default).length ? schema.default : blank({ ...schema, optional: false }, context.root),
    );
  const kind = kindOf(schema);
  const remove =
    !required &&
    isThere &&
    kind !== 'table' &&
    html`
    <button type="button" class="quiet-button" onClick=${() => context.set(path, undefined)} title=${t('use_default')}>${t('reset')}<span class="hidden"> ${label}</span></button>`;
  const direct = context.errorsAt(path);
  const keeping =
    own &&
    html`<${Keeping} own=${own} label=${label} value=${value} isThere=${isThere && context.errorsBelow(path) === 0} use=${part => context.set(path, part)} />`;
  return html`
    <${Fold} title=${label} open=${open} errors=${context.errorsBelow(path)} summary=${summary(schema, value, context.root)} action=${[keeping, remove]} description=${schema.description}>
      <${Faults} faults=${kind === 'table' ? [] : direct} id=${fieldId(path)} names=${context.names} />
      ${
        isThere || required || kind === 'table' || (kind === 'object' && !schema.optional) || kind === 'array' || kind === 'map'
          ? html`<${Body} name=${name} schema=${schema} path=${path} value=${value} context=${context} />`
          : html`<p class="absent"><span>${spoken(schema.description, context.names)}</span><button type="button" onClick=${add}>${t('add')}<span class="hidden"> ${label}</span></button></p>`
      }
    <//>`;
}

/** A part that the user calls his own: kept for every calculator, taken from there, let go. */
function Keeping({ own, label, value, isThere, use }) {
  const mine = useKept(own);
  const isMine = mine !== undefined && isSame(mine, value);
  const button = (act, when, then) =>
    when &&
    html`
    <button type="button" class="quiet-button" data-act=${act} onClick=${then} title=${t(`own_${act}_why`)}>${t(`own_${act}`)}<span class="hidden"> ${label}</span></button>`;
  return html`
    <span data-own=${own}>
      ${button('forget', isMine, () => forget(own))}
      ${button('use', mine !== undefined && !isMine, () => use(mine))}
      ${button('keep', isThere && !isMine, () => keep(own, value))}
    </span>`;
}

/** What a folded part holds, in a few words. */
function summary(schema, value, root) {
  if (value === undefined || value === null) return t('not_set');
  if (Array.isArray(value))
    return value.every(part => typeof part === 'string')
      ? value.map(word => wordOf(schema.items && resolve(schema.items, root), word)).join(', ')
      : `${value.length}`;
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

/** Of a table whose rows name their run: the runs beside it. */
function runsBeside(schema, path, { root, value }) {
  if (!schema['x-runs'] || path.length !== 1) return undefined;
  return { ...runsOf(memberOf(root, value), schema, root), value: value[schema['x-runs']] };
}

/** The inside of a part, whatever it is. */
export function Body({ name, schema, path, value, context }) {
  switch (kindOf(schema)) {
    case 'object':
      return html`<${ObjectFields} schema=${schema} path=${path} value=${value || {}} context=${context} />`;
    case 'choice':
      return html`<${Choice} schema=${schema} path=${path} value=${value} context=${context} />`;
    case 'array':
      return html`<${List} name=${name} schema=${schema} path=${path} value=${value || []} context=${context} />`;
    case 'map':
      return html`<${MapFields} name=${name} schema=${schema} path=${path} value=${value || {}} context=${context} />`;
    case 'table':
      return html`<${TableInput} name=${name} schema=${schema} root=${context.root} value=${value} names=${context.names} runs=${runsBeside(schema, path, context)}
      faults=${context.errorsAt(path)} below=${[...context.errors].filter(([place]) => place.startsWith(`${pointer(path)}/`)).flatMap(([, faults]) => faults)}
      onChange=${(part, runs) => {
        const beside = path.slice(0, -1);
        const whole = changed(at(context.value, beside), [name], part);
        context.set(beside, runs ? changed(whole, [schema['x-runs']], runs) : whole);
      }} />`;
    default:
      return html`<${JsonField} name=${name} schema=${schema} path=${path} value=${value} context=${context} />`;
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

function Fields({ entries, path, value, required, context }) {
  const [all, setAll] = useState(false);
  const isRare = ({ name, schema }) => !required.has(name) && value[name] === undefined && (schema['x-advanced'] || !isLeaf(schema));
  const rare = entries.filter(isRare);
  // One rare field is no reason to hide it.
  const hidden = rare.length > 1 && !all && !rare.some(({ name }) => context.errorsBelow([...path, name]) > 0) ? rare : [];
  return html`
    ${entries
      .filter(entry => !hidden.includes(entry) && kindOf(entry.schema) !== 'constant')
      .map(
        ({ name, schema }) => html`
      <${Field} key=${name} name=${name} schema=${schema} path=${[...path, name]} value=${value[name]} required=${required.has(name)} context=${context} />`,
      )}
    ${hidden.length > 0 && html`<button type="button" class="more" onClick=${() => setAll(true)}>${t('more_fields', { count: hidden.length })}</button>`}`;
}

/** One field: a row if it is a single value, a part of its own if it is more. */
export function Field(props) {
  const { name, schema, path, value, required, context } = props;
  const kind = kindOf(schema);
  if (schema['x-library'] === 'materials' && context.libraries?.materials) return html`<${Row} ...${props} control=${Library} />`;
  if (name === 'model' && kind === 'string' && context.models.length + (value ? 1 : 0) > 0)
    return html`<${Row} ...${props} control=${ModelChoice} />`;
  if (kind === 'number') return html`<${Row} ...${props} control=${NumberInput} />`;
  if (schema['x-text-file']) return html`<${Row} ...${props} control=${TextFile} />`;
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
      <${Faults} faults=${context.errorsAt(path)} id=${`${fieldId(path)}-part`} names=${context.names} />
      ${
        isThere || required || kind === 'array'
          ? html`<${Body} name=${name} schema=${schema} path=${path} value=${value} context=${context} />`
          : html`<p class="absent"><span>${spoken(schema.description, context.names)}</span><button type="button" onClick=${() => set(blank({ ...schema, optional: false }, context.root))}>${t('add')}<span class="hidden"> ${label}</span></button></p>`
      }
    </fieldset>`;
}

/** One of several kinds, each with fields of its own. */
function Choice({ schema, path, value, context }) {
  const list = variants(schema, context.root);
  const now = variantOf(list, value);
  const id = `${fieldId(path)}-kind`;
  const pick = event => {
    const chosen = list[Number(event.currentTarget.value)];
    context.set(path, kept(value, now.schema, chosen, context.root));
  };
  const name = variant => variantName(variant, context.root) ?? t(`form_${kindOf(variant.schema)}`);
  return html`
    <div class="row" ...${explained(context, id, { label: name(now), description: now.schema.description })}>
      <label for=${id} class="label">${t('kind')}</label>
      <span class="control wide"><select id=${id} value=${list.indexOf(now)} onChange=${pick}>
        ${list.map((variant, index) => html`<option value=${index}>${name(variant)}</option>`)}
      </select></span>
    </div>
    ${
      kindOf(now.schema) === 'object'
        ? html`<${ObjectFields} schema=${now.schema} path=${path} value=${value || {}} context=${context} without=${now.tag} />`
        : html`<${Field} name=${path.at(-1)} schema=${now.schema} path=${path} value=${value} required=${true} context=${context} />`
    }`;
}

/** What no other field can show. */
function JsonField({ name, schema, path, value, context }) {
  const [draft, setDraft] = useState(null);
  const [wrong, setWrong] = useState(false);
  const id = fieldId(path);
  useEffect(() => () => mark(id, false), [id]);
  const take = text => {
    setDraft(text);
    let part;
    let isWrong = false;
    try {
      part = text.trim() === '' ? undefined : JSON.parse(text);
    } catch {
      isWrong = true;
    }
    setWrong(isWrong);
    mark(id, isWrong);
    if (!isWrong) context.set(path, part, 'typing');
  };
  return html`<textarea id=${id} rows="4" class="json" spellcheck=${false} aria-label=${labelOf(name, schema)} aria-invalid=${wrong ? 'true' : undefined}
    value=${draft ?? (value === undefined ? '' : JSON.stringify(value, null, 1))} onInput=${event => take(event.currentTarget.value)}></textarea>`;
}

/** Moves the cursor to the field of a fault, or to the nearest part that is shown. */
export function goTo(place) {
  const path = place.split('/').slice(1);
  for (let length = path.length; length > 0; length -= 1) {
    const element = document.getElementById(fieldId(path.slice(0, length)));
    if (element) {
      element.scrollIntoView({ block: 'center' });
      /** @type {HTMLElement | null} */ (
        element.matches('input,select,textarea,button') ? element : element.querySelector('input,select,textarea,button')
      )?.focus();
      return;
    }
  }
}
