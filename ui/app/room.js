// The page of one calculator or evaluation: the form and the picture that follows it. What happens there is `desk.js`.
import { html, useState, useEffect, useRef } from './lib.js';
import { t, capital, language } from './text.js';
import { Form, goTo } from './form.js';
import { unread } from './fields.js';
import { Result } from './result.js';
import { labelOf, memberOf, namesOf, resolve } from './schema.js';
import { Progress, Trouble } from './status.js';
import { Desk } from './desk.js';
import { BrokenLink, queryOf, written } from './address.js';

/** After the form is in sight. */
const soon = task => setTimeout(task, 30);

/** The desk of this page and its state; the page draws anew with each change of it. */
function useDesk({ id, query, replace, push, refreshJobs }) {
  const own = useRef(null);
  if (!own.current) own.current = new Desk({ id, unread, refreshJobs, address: { push, replace } });
  const desk = own.current;
  const [state, setState] = useState(desk.state);
  useEffect(() => {
    setState(desk.state);
    const stop = desk.watch(setState);
    return () => {
      stop();
      desk.close();
    };
  }, []);
  const spoken = language();
  useEffect(() => {
    desk.describe();
  }, [spoken]);
  useEffect(() => {
    desk.open(query);
  }, [Boolean(state.description), query.toString()]);
  // Fields whose text is no value: the answer shown is not one to what is typed.
  const [unreadable, setUnreadable] = useState(unread.get());
  useEffect(() => unread.watch(setUnreadable), []);
  return [desk, state, unreadable];
}

export function Room({ id, query, replace, push, models, refreshJobs }) {
  const [desk, state, unreadable] = useDesk({ id, query, replace, push, refreshJobs });
  const [pane, setPane] = useState('picture');
  const { description, missing, libraries, job, own, baseName, answer, problem, running, pending, waiting, pinned } = state;
  if (missing) {
    const isBroken = missing instanceof BrokenLink;
    return html`<main class="plain" id="main" tabindex="-1"><h1>${isBroken ? t('broken_link') : missing.problem?.title || t('trouble_title')}</h1><p role="alert">${capital(missing.problem?.detail || missing.message)}</p>
      ${isBroken && description?.examples.length > 0 && html`<ul class="plain-list">${description.examples.map(({ id: name, title }) => html`<li key=${name}><a href=${`#/${id}?example=${name}`}>${title}</a></li>`)}</ul>`}
      <p><a href=${`#/${id}`} onClick=${() => setTimeout(() => location.reload(), 0)}>${t('start_over')}</a></p></main>`;
  }
  if (!description || !job) return html`<main class="plain quiet-start" id="main" tabindex="-1"><p>${t('loading')}</p></main>`;

  /** Computes what is typed: not before all of it can be read. */
  const compute = next => {
    const first = /** @type {HTMLElement[]} */ ([...document.querySelectorAll('.form input, .form textarea, .form .matching')]).find(
      field => unread.get().has(field.id),
    );
    if (!first) {
      setPane(next);
      desk.ask(desk.state.job, 'run');
      return;
    }
    setPane('form');
    soon(() => {
      first.scrollIntoView({ block: 'center' });
      first.focus();
    });
  };
  const pickExample = name => {
    desk.isLive = true;
    push(written(new URLSearchParams({ example: name })));
  };
  const go = place => {
    setPane('form');
    soon(() => goTo(place));
  };
  // A run of this calculator is none of a study.
  const ofStudy = baseName.run ? new URLSearchParams({ result: answer?.key }) : queryOf(state, job, answer?.key);
  const study = answer && `#/studies?calculator=${id}&${written(ofStudy)}`;
  const faultCount = (problem?.errors || []).length + unreadable.size;
  const trouble =
    problem &&
    !(['offline', 'cancelled'].includes(problem.code) && answer) &&
    html`<${Trouble} problem=${problem} names=${namesOf(description.input_schema)} over=${Boolean(answer)} onGo=${go} />`;
  return html`
    <main class="room" data-pane=${pane} id="main" tabindex="-1">
      ${
        answer &&
        html`<a class="skip" href="#answer" onClick=${event => {
          event.preventDefault();
          setPane('picture');
          soon(() => document.getElementById('answer')?.focus());
        }}>${t('skip_to_answer')}</a>`
      }
      <div class="pane-switch" role="group" aria-label=${t('panes')}>
        <button type="button" aria-pressed=${pane === 'form'} onClick=${() => setPane('form')}>${t('inputs')}${faultCount > 0 && html` <span class="badge">${faultCount}<span class="hidden"> ${t('faults_here')}</span></span>`}</button>
        <button type="button" aria-pressed=${pane === 'picture'} onClick=${() => setPane('picture')}>${t('result')}</button>
      </div>
      <section class="form-pane" aria-label=${t('inputs')}>
        <h1 class="hidden narrow-title">${description.question}</h1>
        <div class="form-head">
          <label for="example">${t('example')}</label>
          <select id="example" value=${baseName.example || ''} onChange=${event => pickExample(event.currentTarget.value)}>
            ${!baseName.example && html`<option value="">${baseName.result ? t('kept_result') : t('job_of_link')}</option>`}
            ${description.examples.map(({ id: name, title: text }) => html`<option value=${name}>${text}</option>`)}
          </select>
          <button type="button" class=${`primary ${waiting ? 'calling' : ''}`} onClick=${() => compute('picture')} title="Ctrl+Enter">${waiting ? t('run_changed') : t('run')}</button>
          ${own.length > 0 && html`<p class="own-note" role="status">${t('own_used', { parts: own.map(name => labelOf(name, resolve(memberOf(description.input_schema, job).properties[name], description.input_schema)).toLowerCase()).join(', ') })} <a href=${`#/${id}?example=${baseName.example}`}>${t('own_example')}</a></p>`}
        </div>
        <${Form} key=${`${id} ${baseName.example ?? 'kept'}`} schema=${description.input_schema} value=${job} said=${answer?.answer} records=${description.records} onChange=${(next, how) => (how === 'run' ? compute(pane) : desk.change(next, how))} errors=${problem?.errors} examples=${description.jobs} libraries=${libraries} calculator=${id} models=${models} />
      </section>
      <section class="result-pane" aria-label=${t('result')} aria-busy=${pending || running ? 'true' : 'false'}>
        <div class=${`work-line ${pending && !running ? 'on' : ''}`} aria-hidden="true"></div>
        <header class="room-head"><h1>${description.question}</h1><p class="summary">${description.title}</p>${running && html`<${Progress} running=${running} stop=${() => desk.stop()} />`}</header>
        <${Result} ...${{ id, desk, description, answer, problem, trouble, running, pinned, models, study, standing: desk.standing() }} />
      </section>
    </main>`;
}
