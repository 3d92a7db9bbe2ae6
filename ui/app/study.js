// Parameter studies: one to three fields of a calculator's job are varied, every point an answer of its own.
import { html, useState, useEffect, useRef, useMemo } from './lib.js';
import { t, capital, number, typed, unitSymbol, plural, language } from './text.js';
import * as api from './api.js';
import { jobOf } from './address.js';
import { lastJob } from './mine.js';
import { read } from './number.js';
import { mark, unread as unreadFields } from './fields.js';
import { keepRun, keptRun, inputOf } from './runs.js';
import { Progress, Trouble } from './status.js';
import { Picture } from './figure.js';
import { Warnings, usePictureHeight, short } from './result.js';
import { Downloads, WORKBOOK } from './handover.js';
import { RequestView } from './tabs.js';
import { Sheet } from './values.js';
import { parts, namesOf, spoken as labelled, within } from './schema.js';
import { leavesOf, outputsOf, proposed, pointsOf } from './vary.js';

const MOST_VARIED = 3;
const ROWS_SHOWN = 100;
/** Words of the address that belong to the study, not to the job. */
const OWN = ['calculator', 'vary', 'combine', 'outputs', 'study', 'run'];
/** What the words of a varied field are called on this page. */
const OF_VARIED = new Map([
  ['from', 'from'],
  ['to', 'to'],
  ['count', 'number_of_values'],
  ['values', 'value'],
  ['spacing', 'spacing'],
]);
/** What the list of downloads wants to know of a calculator. */
const DECLARED = { media_types: ['application/json', 'text/csv', 'image/svg+xml', WORKBOOK, 'application/pdf'] };

const said = (query, name, otherwise) => {
  try {
    return query.get(name) ? JSON.parse(query.get(name)) : otherwise;
  } catch {
    return otherwise;
  }
};
const jobPart = query => new URLSearchParams([...query].filter(([name]) => !OWN.includes(name) && name !== 'pin'));
const written = query => query.toString().replace(/%2F/g, '/').replace(/%3A/g, ':').replace(/%2C/g, ',');

/** The page: which calculator and which job, then what is made of them. */
export function Study({ calculators, query, push, replace, refreshJobs }) {
  const [opened, setOpened] = useState(null);
  const [missing, setMissing] = useState(null);
  // Counts the times that the service is asked anew.
  const [asking, setAsking] = useState(0);
  // The address as this page wrote it: what it says is shown already.
  const own = useRef(null);
  const kept = query.get('study');
  const run = query.get('run');
  const part = written(jobPart(query));
  const asked = written(query);
  const spoken = language();
  useEffect(() => {
    let gone = false;
    let stopWaiting = null;
    const isOwn = own.current === asked && opened;
    if (isOwn && opened.spoken === spoken) return undefined;
    (async () => {
      try {
        if (isOwn) {
          const description = await api.calculator(opened.description.id);
          if (!gone) setOpened({ ...opened, description, spoken });
          return;
        }
        // A kept study brings its job with it; a running one was put down by the page that started it, or the service has it.
        const stored = kept ? (await api.jobOf(kept)).job : run ? (keptRun(run) ?? (await givenStudy(run))) : null;
        const description = await api.calculator(stored?.calculator || query.get('calculator') || calculators[0].id);
        const job = stored ? stored.job : (await jobOf(description, new URLSearchParams(part))).job;
        if (gone) return;
        own.current = asked;
        setOpened({ description, job, stored, part, spoken, query, serial: (opened?.serial ?? 0) + 1 });
        setMissing(null);
      } catch (error) {
        if (gone) return;
        stopWaiting = api.whenBack(error, () => setAsking(count => count + 1));
        if (!stopWaiting) setMissing(error);
      }
    })();
    return () => {
      gone = true;
      stopWaiting?.();
    };
  }, [asked, spoken, asking]);
  const tell = next => {
    own.current = next;
    replace(next);
  };
  const choose = id => push(written(new URLSearchParams([['calculator', id], ...lastJob(id)])));
  if (missing)
    return html`<main class="plain" id="main" tabindex="-1"><h1>${missing.problem?.title || t('trouble_title')}</h1><p>${capital(missing.problem?.detail || missing.message)}</p><p><a href="#/studies" onClick=${() => setMissing(null)}>${t('start_over')}</a></p></main>`;
  if (!opened) return html`<main class="plain quiet-start" id="main" tabindex="-1"><p>${t('loading')}</p></main>`;
  return html`<${Board} key=${opened.serial} ...${{ ...opened, calculators, choose, tell, refreshJobs }} />`;
}

/** The study that the service was given under that id. */
async function givenStudy(id) {
  const given = await inputOf(id);
  return given?.calculator === 'studies' ? given.job : null;
}

function Board({ description, job, stored, part, query, calculators, choose, tell: write, refreshJobs }) {
  const leaves = useMemo(() => leavesOf(description.input_schema, job), [description, job]);
  const outputs = useMemo(() => outputsOf(description.output_schema, description.study_outputs), [description]);
  const [vary, setVary] = useState(() => stored?.vary || said(query, 'vary', null) || proposed(leaves).map(({ range }) => range));
  const [combine, setCombine] = useState(() => stored?.combine || query.get('combine') || 'grid');
  const [wished, setWished] = useState(() => stored?.outputs || said(query, 'outputs', null) || description.study_outputs);
  const [answer, setAnswer] = useState(null);
  const [problem, setProblem] = useState(null);
  const [running, setRunning] = useState(null);
  const [pending, setPending] = useState(false);
  const [pane, setPane] = useState('picture');
  const control = useRef(null);
  const stop = useRef(null);
  const latest = useRef(null);
  // Fields whose text is no value: nothing that is shown is an answer to it.
  const [unreadable, setUnreadable] = useState(unreadFields.get());
  useEffect(() => unreadFields.watch(setUnreadable), []);
  useEffect(
    () => () => {
      control.current?.abort();
      stop.current?.();
    },
    [],
  );
  const body = { calculator: description.id, job, vary, ...(vary.length > 1 && { combine }), outputs: wished };
  const tell = extra =>
    write(
      written(
        new URLSearchParams([
          ['calculator', description.id],
          ...new URLSearchParams(part),
          ['vary', JSON.stringify(vary)],
          ...(vary.length > 1 ? [['combine', combine]] : []),
          ...(wished.join() === description.study_outputs.join() ? [] : [['outputs', JSON.stringify(wished)]]),
          ...extra,
        ]),
      ),
    );

  const fail = error => {
    if (error.name === 'AbortError') return;
    setPending(false);
    setRunning(null);
    if (error instanceof api.Refused) setProblem(error.problem);
    else if (error instanceof api.Unreachable) setProblem({ title: t('offline_title'), detail: t('offline_detail'), code: 'offline' });
    else throw error;
  };
  const show = async (key, whole, asked, said = language()) => {
    const now = language();
    const signal = control.current?.signal;
    const found = said === now && whole ? whole : await api.patient(() => api.shown(key, signal), signal);
    if (now !== language()) {
      await show(key, null, asked);
      return;
    }
    setAnswer({ key, ...found, asked });
    setPending(false);
    setProblem(null);
  };
  const watch = (record, asked, isOwn) => {
    setRunning({ ...record, isOwn, interim: null });
    refreshJobs();
    stop.current = api.follow(record.id, {
      onState: next => setRunning(old => (old?.id === next.id ? { ...old, ...next } : old)),
      onProgress: progress => setRunning(old => old && { ...old, ...progress }),
      onInterim: interim => setRunning(old => old && { ...old, interim }),
      onTrouble: fail,
      onDone: async done => {
        refreshJobs();
        setRunning(null);
        try {
          if (done.state === 'succeeded' && !asked) location.hash = `#/studies?study=${done.key}`;
          else if (done.state === 'succeeded') {
            await show(done.key, null, asked);
            tell([['study', done.key]]);
          } else {
            setPending(false);
            setProblem(done.problem || { title: t(`state_${done.state}`), code: done.state });
          }
        } catch (error) {
          fail(error);
        }
      },
    });
  };
  const start = async () => {
    control.current?.abort();
    stop.current?.();
    // What somebody else started goes on.
    if (running?.isOwn)
      api
        .cancel(running.id)
        .catch(() => {})
        .then(refreshJobs);
    control.current = new AbortController();
    const { signal } = control.current;
    setPending(true);
    setProblem(null);
    setRunning(null);
    setPane('picture');
    const said = language();
    try {
      const { job: record, ...found } = await api.patient(() => api.solve('studies', body, { signal }), signal);
      if (signal.aborted) return;
      if (record) {
        keepRun(record.id, body);
        tell([['run', record.id]]);
        watch(record, body, true);
      } else {
        await show(found.answer.key, found, body, said);
        tell([['study', found.answer.key]]);
      }
    } catch (error) {
      fail(error);
      if (error instanceof api.Unreachable)
        api.whenBack(error, () => {
          if (!signal.aborted) latest.current();
        });
    }
  };
  latest.current = start;
  /** Computes the study: not before all of it can be read. */
  const compute = event => {
    event.preventDefault();
    const first = /** @type {HTMLElement | undefined} */ (
      [...document.querySelectorAll('.study-form input')].find(field => unreadFields.get().has(field.id))
    );
    if (!first) {
      start();
      return;
    }
    setPane('form');
    setTimeout(() => {
      first.scrollIntoView({ block: 'center' });
      first.focus();
    }, 30);
  };
  // A study of the address: kept, or on its way.
  useEffect(() => {
    control.current = new AbortController();
    const { signal } = control.current;
    const [kept, run] = [query.get('study'), query.get('run')];
    const again = error => {
      const waits = api.whenBack(error, () => {
        if (!signal.aborted) open();
      });
      if (!waits || !api.isBusy(error)) fail(error);
    };
    const open = () => {
      if (!kept && !run) return;
      setPending(true);
      if (kept) {
        show(kept, null, stored).catch(again);
        return;
      }
      api.job(run).then(record => {
        if (['queued', 'running', 'succeeded'].includes(record.state)) watch(record, stored, keptRun(run) !== null);
        else {
          setPending(false);
          setProblem(record.problem || { title: t(`state_${record.state}`), code: record.state });
        }
      }, again);
    };
    open();
  }, []);
  // The words of the service in another language.
  const spoken = useRef(language());
  useEffect(() => {
    if (spoken.current === language()) return;
    spoken.current = language();
    if (problem?.errors) start();
    else if (answer) show(answer.key, null, answer.asked).catch(fail);
  }, [language()]);

  const names = useMemo(
    () =>
      new Map([
        ...namesOf(description.input_schema),
        ...[['job', 'inputs'], ['vary', 'field'], ['outputs', 'read_off'], ...OF_VARIED].map(([name, code]) => [name, t(code)]),
      ]),
    [description, language()],
  );
  // The service names what is varied by the names of the contract.
  const named = fault => {
    const index = /^\/vary\/(\d+)/.exec(fault.pointer)?.[1];
    const leaf = index !== undefined && leaves.find(one => one.pointer === vary[index]?.pointer);
    const detail = fault.detail.replace(/^(\w+)(?:\.\d+)?(?= (?:=|is) )/, (word, name) =>
      name === 'vary' && leaf ? within(leaf.label.split(' · ').at(-1)) : OF_VARIED.has(name) ? within(t(OF_VARIED.get(name))) : word,
    );
    return { ...fault, detail: labelled(detail, names) };
  };
  const faults = (problem?.errors || []).map(named);
  const below = place => faults.filter(fault => fault.pointer === place || fault.pointer?.startsWith(`${place}/`));
  const points = pointsOf(vary, combine);
  const go = place => {
    setPane('form');
    const index = /^\/vary\/(\d+)/.exec(place)?.[1];
    setTimeout(() => document.getElementById(index === undefined ? 'study-calculator' : `vary-${index}`)?.focus(), 30);
  };
  // A kept study has no page of its job, but its points have.
  const ofPoint = answer?.answer.result.rows.find(({ status }) => status === 'succeeded')?.key;
  const page = !stored ? `#/${description.id}${part ? `?${part}` : ''}` : ofPoint && `#/${description.id}?result=${ofPoint}`;
  const begun = useRef(JSON.stringify(body));
  const touched = JSON.stringify(body) !== begun.current;
  // A kept study is its own job; one that is changed, on its way, refused or not to be read has no answer to take away.
  const isAsked = answer && (JSON.stringify(answer.asked) === JSON.stringify(body) || (stored && !touched));
  const stale = Boolean(answer && (!isAsked || pending || running || problem || unreadable.size > 0));
  const current = useRef(null);
  current.current = stale ? null : answer?.key;
  const owns = key => current.current === key && unreadFields.get().size === 0;
  const trouble =
    problem &&
    html`<${Trouble} problem=${problem.errors ? { ...problem, errors: faults } : problem} names=${names} over=${Boolean(answer)} onGo=${go} />`;
  return html`
    <main class="room" data-pane=${pane} id="main" tabindex="-1">
      <div class="pane-switch" role="group" aria-label=${t('panes')}>
        <button type="button" aria-pressed=${pane === 'form'} onClick=${() => setPane('form')}>${t('inputs')}${faults.length > 0 && html` <span class="badge">${faults.length}<span class="hidden"> ${t('faults_here')}</span></span>`}</button>
        <button type="button" aria-pressed=${pane === 'picture'} onClick=${() => setPane('picture')}>${t('result')}</button>
      </div>
      <section class="form-pane" aria-label=${t('inputs')}>
        <h1 class="hidden narrow-title">${t('study_question')}</h1>
        <div class="form-head">
          <label for="study-calculator">${t('calculator')}</label>
          <select id="study-calculator" value=${description.id} onChange=${event => choose(event.currentTarget.value)}>${calculators.map(({ id, title }) => html`<option value=${id}>${title}</option>`)}</select>
          <button type="button" id="run-study" class="primary" onClick=${compute} disabled=${vary.length === 0} title="Ctrl+Enter">${t('run')}</button>
        </div>
        <form class="form study-form" onSubmit=${compute} novalidate aria-label=${t('inputs')}>
          <div class="sections">
            <section class="fold open"><div class="fold-body study-part">
              <p>${stored ? t('job_of_study') : t('job_of_page')} ${page && html`<a href=${page}>${t('change_job')}</a>`}</p>
            </div></section>
            <section class="fold open"><div class="fold-head"><h2 class="study-head">${t('varied')}</h2></div><div class="fold-body study-part">
              ${vary.map(
                (
                  variable,
                  index,
                ) => html`<${Varied} key=${index} ...${{ index, variable, leaves, taken: vary.map(one => one.pointer), faults: below(`/vary/${index}`) }}
                set=${next => setVary(vary.map((one, other) => (other === index ? next : one)))} remove=${vary.length > 1 ? () => setVary(vary.filter((_, other) => other !== index)) : null} />`,
              )}
              ${
                vary.length < Math.min(MOST_VARIED, leaves.length) &&
                html`<button type="button" class="more" id="add-varied" onClick=${() =>
                  setVary([
                    ...vary,
                    proposed(
                      leaves,
                      vary.map(one => one.pointer),
                    )[0].range,
                  ])}>${t('vary_another')}</button>`
              }
              ${vary.length > 1 && html`<div class="study-field"><label for="combine">${t('combine')}</label><select id="combine" value=${combine} onChange=${event => setCombine(event.currentTarget.value)}><option value="grid">${t('combine_grid')}</option><option value="zip">${t('combine_zip')}</option></select></div>`}
              <p class="quiet" id="study-points">${plural('points', points)}</p>
              ${faults.filter(({ pointer: place }) => place === '/vary').map(({ detail }) => html`<p class="fault"><span>${capital(detail)}</span></p>`)}
            </div></section>
            <section class="fold open"><div class="fold-head"><h2 class="study-head">${t('read_off')}</h2></div><div class="fold-body study-part">
              <div class="ticks" id="study-outputs">${outputs.map(output => html`<label key=${output.pointer} title=${output.description}><input type="checkbox" checked=${wished.includes(output.pointer)} onChange=${event => setWished(event.currentTarget.checked ? [...wished, output.pointer] : wished.filter(one => one !== output.pointer))} /> ${output.label} <span class="unit">${output.unit}</span></label>`)}</div>
              ${below('/outputs').map(({ detail }) => html`<p class="fault"><span>${capital(detail)}</span></p>`)}
            </div></section>
          </div>
          <div class="help" aria-hidden="true"><p class="quiet">${t('study_hint')}</p></div>
        </form>
      </section>
      <section class="result-pane" aria-label=${t('result')} aria-busy=${pending || running ? 'true' : 'false'}>
        <div class=${`work-line ${pending && !running ? 'on' : ''}`} aria-hidden="true"></div>
        <header class="room-head"><h1>${t('study_question')}</h1><p class="summary">${description.title}</p>${running && html`<${Progress} running=${running} stop=${() => api.cancel(running.id).catch(fail)} />`}</header>
        ${answer && trouble}
        ${
          !answer && !running?.interim
            ? html`<div class="empty">${problem ? html`<div class="no-answer">${trouble}</div>` : running ? '' : html`<p>${pending ? t('first_answer') : t('study_empty')}</p>`}</div>`
            : html`<${Findings} ...${{ answer, interim: running?.interim, leaves, outputs, description }} ...${{ stale, owns }} />`
        }
      </section>
    </main>`;
}

/** One field and its values: a range, or a list. */
function Varied({ index, variable, leaves, taken, faults, set, remove }) {
  const leaf = leaves.find(one => one.pointer === variable.pointer);
  const isList = Boolean(variable.values);
  const [draft, setDraft] = useState({});
  useEffect(() => setDraft({}), [variable.pointer]);
  const groups = [...new Set(leaves.map(({ group }) => group))];
  const pick = place => {
    setDraft({});
    set(proposed(leaves.filter(one => one.pointer === place))[0].range);
  };
  const unit = leaf?.schema['x-unit'];
  const listed = text => {
    if (leaf?.kind === 'number')
      return text
        .split(/[;\n\t]/.test(text) ? /[;\n\t]+/ : /\s+/)
        .filter(part => part.trim())
        .map(part => read(part, unit));
    return text
      .split(/[;,\s]+/)
      .filter(Boolean)
      .map(word => ({ value: leaf?.kind === 'boolean' ? word === 'true' : word }));
  };
  const found = (name, text) =>
    name === 'values' ? listed(text) : [read(text, name === 'count' ? '1' : unit)].filter(({ value }) => value !== null);
  const faultOf = (name, text) => {
    const values = found(name, text);
    return values.length === 0 ? { fault: 'needed' } : (values.find(({ fault }) => fault) ?? null);
  };
  const take = (name, text) => {
    setDraft({ ...draft, [name]: text });
    if (faultOf(name, text) === null) set({ ...variable, [name]: found(name, text)[0].value });
  };
  const takeList = text => {
    setDraft({ ...draft, values: text });
    if (faultOf('values', text) === null) set({ pointer: variable.pointer, values: listed(text).map(({ value }) => value) });
  };
  const id = name => `vary-${index}-${name}`;
  // A draft that is no value stays, and says so.
  const unread = Object.keys(draft)
    .map(name => [name, faultOf(name, draft[name])])
    .filter(([, fault]) => fault !== null);
  useEffect(() => {
    const ids = unread.map(([name]) => id(name));
    ids.forEach(one => mark(one, true));
    return () => ids.forEach(one => mark(one, false));
  }, [unread.map(([name]) => name).join()]);
  const leave = name => {
    if (!unread.some(([other]) => other === name)) setDraft(({ [name]: done, ...others }) => others);
  };
  const about = name => {
    const isUnread = unread.some(([other]) => other === name);
    const isRefused = faults.some(({ pointer: place }) => place.split('/')[3] === name);
    return {
      'aria-invalid': isUnread || isRefused ? 'true' : undefined,
      'aria-describedby': isUnread ? id(`${name}-fault`) : undefined,
      onBlur: () => leave(name),
    };
  };
  const field = (name, label) =>
    html`<label class="study-field">${label}<input id=${id(name)} type="text" inputmode="decimal" autocomplete="off" value=${draft[name] ?? typed(variable[name])} ...${about(name)} onInput=${event => take(name, event.currentTarget.value)} /></label>`;
  const range = { pointer: variable.pointer, from: leaf?.range?.from ?? 0, to: leaf?.range?.to ?? 1, count: 5 };
  return html`
    <fieldset class="item varied">
      <legend><span>${t('field')} ${index + 1}</span>${remove && html`<button type="button" class="icon" aria-label=${`${t('remove')}: ${t('field')} ${index + 1}`} onClick=${remove}>×</button>`}</legend>
      <select id=${`vary-${index}`} aria-label=${`${t('field')} ${index + 1}`} value=${variable.pointer} onChange=${event => pick(event.currentTarget.value)}>
        ${!leaf && html`<option value=${variable.pointer}>${variable.pointer}</option>`}
        ${groups.map(group => html`<optgroup label=${group || t('inputs')}>${leaves.filter(one => one.group === group).map(one => html`<option value=${one.pointer} disabled=${one.pointer !== variable.pointer && taken.includes(one.pointer)}>${one.label}${one.unit ? `, ${one.unit}` : ''}</option>`)}</optgroup>`)}
      </select>
      ${
        leaf?.kind === 'number' &&
        html`<div class="study-way" role="group" aria-label=${t('values_of', { name: leaf.label })}>
        <label><input type="radio" name=${id('way')} checked=${!isList} onChange=${() => {
          setDraft({});
          set(range);
        }} /> ${t('a_range')}</label>
        <label><input type="radio" name=${id('way')} checked=${isList} onChange=${() => {
          setDraft({});
          set({ pointer: variable.pointer, values: valuesOf(variable) });
        }} /> ${t('a_list')}</label></div>`
      }
      ${
        isList
          ? html`<input id=${id('values')} type="text" aria-label=${t('values_of', { name: leaf?.label || variable.pointer })} placeholder=${t('numbers_hint')} value=${draft.values ?? variable.values.map(value => (typeof value === 'number' ? typed(value) : String(value))).join('; ')} ...${about('values')} onInput=${event => takeList(event.currentTarget.value)} />`
          : html`<div class="study-range">${field('from', t('from'))}${field('to', t('to'))}${field('count', t('how_many'))}
          <label class="study-field">${t('spacing')}<select id=${id('spacing')} value=${variable.spacing || 'linear'} onChange=${event => set({ ...variable, spacing: event.currentTarget.value })}><option value="linear">${t('spacing_linear')}</option><option value="log">${t('spacing_log')}</option></select></label></div>`
      }
      ${leaf && html`<p class="quiet study-now">${t('value_now')} ${typeof leaf.value === 'number' ? number(leaf.value, 6) : leaf.value === undefined ? t('not_set') : String(leaf.value)} ${leaf.unit}</p>`}
      ${unread.map(([name, fault]) => html`<p class="fault" key=${name} id=${id(`${name}-fault`)}><span>${name === 'values' ? '' : `${t(OF_VARIED.get(name))}: `}${t(fault.fault, fault.values)}</span></p>`)}
      ${faults.map(({ detail }) => html`<p class="fault" role="alert"><span>${capital(detail)}</span></p>`)}
    </fieldset>`;
}

/** A range as the list that it stands for, to begin with. */
function valuesOf({ from, to, count, spacing }) {
  const number_ = Math.min(Math.max(count || 2, 2), 50);
  const share = index => index / (number_ - 1);
  return Array.from({ length: number_ }, (_, index) =>
    Number((spacing === 'log' ? from * (to / from) ** share(index) : from + (to - from) * share(index)).toPrecision(6)),
  );
}

/** What came out: pictures, a sentence, one row per point. */
function Findings({ answer, interim, leaves, outputs, description, stale, owns }) {
  const calculator = description.id;
  const [chosen, setChosen] = useState(null);
  const [picked, setPicked] = useState(null);
  const result = answer?.answer.result;
  const all = interim ? [interim] : answer?.figures || [];
  const figure = all.find(({ id }) => id === chosen) || all[0];
  const isEmpty = figure && !figure.panels.some(panel => panel.items.some(item => (item.values || item.y).some(value => value !== null)));
  const height = usePictureHeight();
  const pick = figure?.id === 'map' && result && result.variables.length === 2 ? (x, y) => setPicked(nearestRow(result, x, y)) : null;
  const [first, ...others] = answer?.answer.explanation || [];
  return html`
    <p class="not-printed">${t('not_printed')}</p>
    <div class=${`result ${stale ? 'stale' : ''}`}>
      ${all.length > 1 && html`<div class="figure-choice" role="group" aria-label=${t('figures')}>${all.map(({ id, title }) => html`<button type="button" key=${id} aria-pressed=${figure.id === id} onClick=${() => setChosen(id)}>${id === 'map' ? t('study_map') : id === 'curves' ? t('study_curves') : short(title.text)}</button>`)}</div>`}
      <div class="picture-and-words">
        <div class="picture-box">
          ${figure && !isEmpty ? html`<${Picture} key=${figure.id} figure=${figure} height=${height} onPick=${pick} main />` : html`<p class="quiet">${t('no_figure')}</p>`}
          <div class="under">${(interim || stale) && html`<p class="so-far" role="status">${interim ? t('so_far') : t('stale_note')}</p>`}</div>
          ${pick && !isEmpty && picked === null && html`<p class="quiet hint">${t('click_for_row')}</p>`}
          ${result && picked !== null && html`<${Point} result=${result} index=${picked} calculator=${calculator} names=${namesOf(description.input_schema)} />`}
        </div>
        ${
          result &&
          html`<div class="words">
          ${first && html`<p class="verdict" aria-live="polite">${capital(first.text)}</p>`}
          <${Warnings} key=${answer.key} list=${answer.answer.warnings} names=${namesOf(description.input_schema)} />
          <ul class="explanation">${others.map(({ code, text }, index) => html`<li key=${code + index}>${capital(text)}</li>`)}</ul>
        </div>`
        }
      </div>
      ${
        result &&
        html`
        <div class="bar"><span class="quiet">${plural('points', result.points)}${result.failed > 0 ? `, ${t('without_answer', { count: result.failed })}` : ''}</span><${Downloads} id="studies" description=${DECLARED} answer=${answer} figure=${figure} stale=${stale} owns=${owns} /></div>
        <${Rows} ...${{ result, leaves, outputs, calculator, picked }} names=${namesOf(description.input_schema)} />
        ${answer.asked && html`<details class="tabs request"><summary>${t('tab_request')}</summary><div><${RequestView} id="studies" job=${answer.asked} answer=${answer} stale=${stale} link=${`#/studies?study=${answer.key}`} /></div></details>`}
        <${Sheet} description=${description} body=${answer.answer} job=${answer.answer.input.job} />`
      }
    </div>`;
}

/** Why a point has no answer. */
const WHY = {
  invalid: 'why_invalid',
  infeasible: 'why_infeasible',
  out_of_model: 'why_out_of_model',
  not_converged: 'why_not_converged',
  failed: 'why_failed',
};
const shownSetting = value =>
  typeof value === 'number' ? number(value, 6) : value === true ? t('yes') : value === false ? t('no') : String(value);
const nearestRow = ({ variables, rows }, x, y) => {
  const near = (list, value) => list.reduce((best, one) => (Math.abs(one - value) < Math.abs(best - value) ? one : best));
  const [a, b] = [near(variables[0].values, x), near(variables[1].values, y)];
  return rows.findIndex(({ values }) => values[0] === a && values[1] === b);
};

function Point({ result, index, calculator, names }) {
  const row = result.rows[index];
  if (!row) return null;
  return html`<p class="hint" role="status">${t('row')} ${index + 1}: ${row.values.map(shownSetting).join('; ')} → ${row.status === 'succeeded' ? row.outputs.map(value => number(value, 5)).join('; ') : capital(labelled(row.detail, names) || t(WHY[row.status]))} ${row.key && row.status === 'succeeded' && html`<a href=${`#/${calculator}?result=${row.key}`}>${t('open_point')}</a>`}</p>`;
}

/** One row per point; what has no answer says why. */
function Rows({ result, leaves, outputs, calculator, picked, names }) {
  const [shown, setShown] = useState(ROWS_SHOWN);
  const { variables, outputs: read_, rows } = result;
  const named = (list, place) => list.find(one => one.pointer === place)?.label || capital(parts(place).join(' ').replace(/_/g, ' '));
  return html`
    <div class="grid-scroll tall tabs" tabindex="0" role="region" aria-label=${t('table')}><table class="grid still study-rows">
      <thead><tr>${variables.map(({ pointer: place, unit }) => html`<th scope="col">${named(leaves, place)} <span class="unit">${unitSymbol(unit)}</span></th>`)}${read_.map(({ pointer: place, unit }) => html`<th scope="col">${named(outputs, place)} <span class="unit">${unitSymbol(unit)}</span></th>`)}<th><span class="hidden">${t('actions')}</span></th></tr></thead>
      <tbody>${rows.slice(0, shown).map(
        (
          row,
          index,
        ) => html`<tr key=${index} class=${index === picked ? 'picked' : ''}>${row.values.map(value => html`<td>${shownSetting(value)}</td>`)}
        ${row.status === 'succeeded' ? row.outputs.map(value => html`<td>${value === null ? '' : number(value, 5)}</td>`) : html`<td class="word reason" colspan=${read_.length}><span class="state failed">${t(WHY[row.status])}</span> ${capital(labelled(row.detail, names))}</td>`}
        <td>${row.key && row.status === 'succeeded' ? html`<a href=${`#/${calculator}?result=${row.key}`}>${t('open_point')}<span class="hidden"> ${index + 1}</span></a>` : ''}</td></tr>`,
      )}</tbody>
    </table></div>
    ${rows.length > shown && html`<button type="button" class="more" onClick=${() => setShown(shown + 1000)}>${t('more_rows', { count: rows.length - shown })}</button>`}`;
}
