// What a run gave: the answer, the picture, the words, and everything else behind tabs.
import { html, useState, useEffect, useLayoutEffect, useMemo, usePrinting } from './lib.js';
import { t, capital } from './text.js';
import * as api from './api.js';
import { Picture, differenceOf, isLowScreen } from './figure.js';
import { namesOf, spoken } from './schema.js';
import { replayOf, Replay } from './replay.js';
import { triedIn, held, Trial } from './trial.js';
import { placeOf, settingsOf } from './elsewhere.js';
import { Bars } from './bars.js';
import { Program, lineAt, useProgram } from './program.js';
import { causesOf, causesHeadline, saidOfCauses, nextAdvised, Causes } from './cause.js';
import { hasOffers, Offers } from './offers.js';
import { sheetOf, takeSheet } from './inspection.js';
import { movedJob } from './handles.js';
import { isDrawn } from './draw.js';
import { Downloads, fileName } from './handover.js';
import { Strip, sentences, declared } from './strip.js';
import { Tabs } from './tabs.js';
import { Sheet } from './values.js';

/** The curve above what is tried leaves room for it. */
const TRIAL_HEIGHT = 260;
/** More warnings than these are folded. */
const FEW_WARNINGS = 3;
/** More pictures than these are chosen from a list. */
const MOST_BUTTONS = 6;
/** What the panels have before it is measured, and at least, on a low screen and on others, and at most; what a chart needs
 *  around its panel, the last one for the axis, and what is left free below. */
const FIRST_ROOM = 260;
const LEAST_LOW_ROOM = 100;
const LEAST_ROOM = 240;
const MOST_ROOM = 900;
const CHART_ROOM = 14;
const AXIS_ROOM = 32;
const END_ROOM = 10;
/** What was measured last: where the next picture begins. */
let lately = FIRST_ROOM;
/** The height that the panels of a picture may have: it is measured, so that the picture ends where the screen does. */
export function usePictureHeight() {
  const [room, setRoom] = useState(lately);
  // Names stand above the panels in as many lines as they need: what they leave does not depend on the panels.
  useLayoutEffect(() => {
    /** @type {HTMLElement | null} */
    const plot = document.querySelector('.picture.main .plot');
    if (!plot) return undefined;
    const measure = () => {
      const charts = [...plot.querySelectorAll('svg.chart')];
      const box = plot.getBoundingClientRect();
      if (charts.length === 0 || box.height === 0) return;
      const charted = charts.reduce((sum, chart) => sum + chart.getBoundingClientRect().height, 0);
      const axes = charts[0].classList.contains('polar') ? 0 : CHART_ROOM * charts.length + AXIS_ROOM;
      // What goes through a run stands below its picture, in sight with it where there is room.
      const scrubber = isLowScreen() ? null : plot.closest('.picture-box')?.querySelector('.scrubber');
      const below = scrubber ? scrubber.getBoundingClientRect().height + END_ROOM : 0;
      lately = Math.round(innerHeight - (box.top + scrollY) - (box.height - charted) - axes - below - END_ROOM);
      setRoom(lately);
    };
    const observer = new ResizeObserver(measure);
    observer.observe(plot);
    addEventListener('resize', measure);
    return () => {
      observer.disconnect();
      removeEventListener('resize', measure);
    };
  });
  return Math.min(MOST_ROOM, Math.max(isLowScreen() ? LEAST_LOW_ROOM : LEAST_ROOM, room));
}

const drawn = figure => figure.panels.flatMap(panel => panel.items).filter(item => isDrawn(item) && item.x.length > 0);
/** Pictures of what the job did not ask for are empty: they are not offered. */
const shownOf = figures => {
  const some = figures.filter(figure => drawn(figure).length > 0);
  return some.length > 0 ? some : figures.slice(0, 1);
};
/** Whether a picture shows more than a single point. */
const isTelling = figure => drawn(figure).some(({ kind, x }) => kind !== 'points' || x.length > 1);

/** What changed in the numbers of the strip since they were `before`. */
const effectOn = (before, now) =>
  now.flatMap((row, index) =>
    before[index]?.label === row.label && before[index].text !== row.text
      ? [`${row.label} ${before[index].text} → ${row.text} ${row.unit ?? ''}`.trim()]
      : [],
  );

/** What a hand does in a picture: `put` a setting of it elsewhere, `hold` one of its handles; and the `effect` of what was
 *  pulled last on the numbers of the strip. */
function useHands({ desk, figure, body, told }) {
  const [pulled, setPulled] = useState(null);
  const take = name => setPulled(before => (before?.name === name && before.isHeld ? before : { name, told, isHeld: true }));
  const letGo = () => setPulled(before => before && { ...before, isHeld: false });
  return {
    effect: pulled && { name: pulled.name, texts: effectOn(pulled.told, told) },
    // What takes long is computed when it is let go.
    put: (setting, x, y, how) => {
      take(setting.name);
      if (how === 'run') letGo();
      desk.places.put(placeOf(figure, setting, x, y), how);
    },
    // Numbers of the job follow a handle from where they are when it is taken.
    hold: taken => {
      const { job } = desk.state;
      take(taken.name);
      return {
        move: to => desk.change(movedJob(job, body.input, taken, to - taken[taken.along]), 'typing'),
        drop: () => {
          letGo();
          if (desk.state.waiting) desk.ask(desk.state.job, 'run');
        },
      };
    },
  };
}

/** What a diagnosis is made for: the model that it found, or else the measurement that would find one. */
function actOf({ id, model, causes, sheet, answer, owns }) {
  if (model && causes.isNamed)
    return {
      text: t('take_model'),
      act: () => {
        const field = document.getElementById('model-name');
        field?.scrollIntoView({ block: 'center' });
        field?.focus();
      },
    };
  return sheet ? { text: t('take_sheet_next'), act: () => takeSheet(sheet, fileName(id, answer), owns, answer.key) } : null;
}

/** Where there is no answer yet. */
function NoAnswer({ running, problem, trouble }) {
  const said = problem
    ? html`<div class="no-answer">${trouble}<p>${problem.code === 'cancelled' ? t('cancelled_waits') : t('picture_waits')}</p></div>`
    : html`<p class="late">${t('first_answer')}</p>`;
  return html`<div class="empty">${running ? '' : said}</div>`;
}

/** The main picture, with what it can be asked: its run state by state, a setting tried along it. */
function MainPicture({ id, desk, description, answer, pinned, interim, figure, figures, difference, told, apply, program }) {
  // An earlier state of the same run, in place of its end.
  const [earlier, setEarlier] = useState(null);
  // Where along a curve another setting is tried.
  const [tried, setTried] = useState(null);
  useEffect(() => {
    setEarlier(null);
    setTried(null);
  }, [answer?.key]);
  const body = answer?.answer;
  const height = usePictureHeight();
  const { effect, put, hold } = useHands({ desk, figure, body, told });
  const twin = twinOf({ pinned, interim, answer, figure });
  const subtracted = twin && difference ? differenceOf(figure, twin) : null;
  const isOwn = Boolean(body && !interim && !subtracted);
  const replay = isOwn ? replayOf(description, figure, body.result) : null;
  const trial = isOwn ? triedIn(figure) : undefined;
  const isHeld = isOwn && !earlier;
  const pick = isOwn && program?.moves.length > 0 ? (x, y, panel) => program.choose(lineAt(program.moves[panel], { x, y })) : undefined;
  return html`
    <${Picture} key=${figure.id} figure=${subtracted?.panels.length ? subtracted : (replay && earlier) || figure} pinned=${subtracted ? null : twin} height=${trial ? Math.min(height, TRIAL_HEIGHT) : height} main
      onPut=${isHeld ? put : null} trial=${trial && { x: tried ?? trial.x, move: x => setTried(held(figure, x)) }} onHold=${isHeld ? hold : null} effect=${effect} onPick=${pick} marks=${isOwn ? program?.marks : null} />
    ${twin && html`<p class="pin-legend">${subtracted ? t('pinned_less') : t('pinned_shadow')}</p>`}
    <div class="under">${interim && html`<p class="so-far" role="status">${t('so_far')}</p>`}</div>
    ${replay && html`<${Replay} key=${answer.key} id=${id} said=${replay} answer=${body} job=${answer.job} figure=${figure} figures=${figures} onShow=${setEarlier} />`}
    ${trial && html`<${Trial} key=${answer.key} ...${{ id, desk, figure, setting: trial, figures, answer, apply }} x=${tried ?? trial.x} setX=${setTried} />`}
    ${isOwn && !trial && html`<${PlaneHint} figure=${figure} />`}
    ${pick && html`<p class="quiet hint">${t('press_a_cut')}</p>`}`;
}

/** The same picture of the pinned run, where it is another run. */
const twinOf = ({ pinned, interim, answer, figure }) =>
  pinned && !interim && pinned.key !== answer?.key ? pinned.figures.find(({ id: name }) => name === figure?.id) : null;

/** The pictures of an answer by their names. */
function FigureChoice({ figures, figure, choose }) {
  if (figures.length > MOST_BUTTONS) return html`<${FigurePick} ...${{ figures, figure, choose }} />`;
  if (figures.length < 2) return null;
  const isAlone = text => figures.filter(other => short(other.title.text) === short(text)).length === 1;
  return html`
    <div class="figure-choice" role="group" aria-label=${t('figures')}>
      ${figures.map(({ id: name, title: { text } }) => html`<button type="button" key=${name} aria-pressed=${figure.id === name} onClick=${() => choose(name)}>${isAlone(text) ? short(text) : text}</button>`)}
    </div>`;
}

/** What can be done with an answer: compared, varied, taken away. */
function Bar({ id, desk, description, answer, pinned, study, figure, difference, setDifference, stale, owns }) {
  return html`
    <div class="bar">
      <button type="button" aria-pressed=${Boolean(pinned)} onClick=${() => desk.pin()}>${pinned ? t('unpin') : t('pin')}</button>
      ${
        pinned &&
        (pinned.key === answer.key
          ? html`<span class="quiet">${t('pinned_same')}</span>`
          : html`
        <label><input type="checkbox" checked=${difference} onChange=${event => setDifference(event.currentTarget.checked)} /> ${t('draw_difference')}</label>
        <a href=${`#/${id}?result=${pinned.key}`}>${t('open_pinned')}</a>`)
      }
      ${study && html`<a class="button" id="vary" href=${study}>${t('vary_fields')}</a>`}
      <${Downloads} ...${{ id, description, answer, figure, stale, owns }} />
    </div>`;
}

export function Result({ id, desk, description, answer, problem, trouble, running, pinned, models, study, standing }) {
  const stale = !['none', 'current'].includes(standing);
  const owns = key => desk.owns(key);
  const apply = job => {
    if (owns(answer.key)) desk.change(job, 'run');
  };
  const [chosen, setChosen] = useState(null);
  const [difference, setDifference] = useState(false);
  const interim = running?.interim;
  const figures = shownOf(answer?.figures || []);
  const figure = interim || figures.find(({ id: name }) => name === chosen) || figures.find(isTelling) || figures[0];
  const body = answer?.answer;
  const told = useMemo(() => (body ? declared(description, body.result) : []), [body, description]);
  const causes = useMemo(() => (body ? causesOf(description, body, answer.figures) : null), [answer, description]);
  const numbers = useMemo(() => causesHeadline(causes), [causes]);
  const sheet = useMemo(() => (nextAdvised(causes) ? sheetOf(description, body, answer.job) : null), [answer, causes]);
  // The sheet for print is of the answer alone: it is not made anew with every letter.
  const paper = useMemo(() => body && html`<${Sheet} description=${description} body=${body} job=${answer.job} />`, [answer, description]);
  const model = models && causes?.named.length > 0;
  const program = useProgram({ description, answer, figure: interim ? null : figure, job: desk.state.job, problem });
  const names = namesOf(description.input_schema);
  const listing = program && html`<${Program} ...${{ program, description, answer, names }} />`;
  if (!answer && !interim)
    return html`<${NoAnswer} ...${{ running, problem, trouble }} />${program?.faults.length > 0 && html`<div class="with-program">${listing}</div>`}`;
  const [first, ...more] = body?.explanation.filter(({ code }) => !(causes && !causes.isSilent && saidOfCauses(code))) || [];
  // The answer is its first sentence; what else was said with it stands among the words.
  const [said, ...rest] = sentences(first?.text ?? '');
  const others = [...(rest.length > 0 ? [{ code: first.code, text: rest.join(' ') }] : []), ...more];
  return html`
    ${body && html`<${Strip} ...${{ id, description, answer, said, limits: numbers ? undefined : sentences(more[0]?.text ?? '')[0], numbers: numbers ?? told, main: actOf({ id, model, causes, sheet, answer, owns }), standing, owns, trouble }} />`}
    <p class="not-printed">${t('not_printed')}</p>
    <div class=${`result ${stale ? 'stale' : ''}`}>
      ${!interim && html`<${FigureChoice} ...${{ figures, figure, choose: setChosen }} />`}
      <div class="picture-and-words">
        <div class=${`picture-box ${listing ? 'with-program' : ''}`}>
          ${listing}
          <div class="picture-of-it">
          ${figure ? html`<${MainPicture} ...${{ id, desk, description, answer, pinned, interim, figure, figures, difference, told, apply, program }} />` : html`<p class="quiet">${t('no_figure')}</p>`}
          </div>
        </div>
        ${
          body &&
          html`
        <div class="words">
          <${Warnings} key=${answer.key} list=${body.warnings} names=${names} />
          ${hasOffers(description, body.result) && html`<${Offers} ...${{ description, answer, isCurrent: !stale, apply }} />`}
          <${Bars} result=${body.result} input=${body.input} description=${description} />
          ${causes && html`<${Causes} ...${{ causes, sheet, answer, owns, stale }} title=${description.title} name=${fileName(id, answer)} />`}
          ${others.length > 0 && html`<ul class="explanation">${others.map(({ code, text }, index) => html`<li key=${code + index}>${capital(text)}</li>`)}</ul>`}
        </div>`
        }
      </div>
      ${
        body &&
        html`
        <${Bar} ...${{ id, desk, description, answer, pinned, study, figure, difference, setDifference, stale, owns }} />
        ${model && html`<${SaveModel} resultKey=${answer.key} stale=${stale} owns=${owns} />`}
        <${Tabs} ...${{ id, description, answer, pinned, stale, owns }} />
        ${paper}`
      }
    </div>`;
}

/** How another place of the picture is tried, and what goes along. */
function PlaneHint({ figure }) {
  const [setting] = settingsOf(figure);
  if (!setting) return null;
  return html`<p class="quiet hint">${t(figure.frame === 'polar' ? 'pull_to_try' : 'click_to_try')}${setting.about && ` ${setting.about.text}`}</p>`;
}

/** Many pictures: a list, and the way to the next and the one before. */
function FigurePick({ figures, figure, choose }) {
  const at = figures.indexOf(figure);
  const go = step => choose(figures[(at + step + figures.length) % figures.length].id);
  return html`
    <div class="figure-pick" role="group" aria-label=${t('figures')}>
      <button type="button" class="icon" aria-label=${t('picture_before')} title=${t('picture_before')} onClick=${() => go(-1)}>‹</button>
      <select id="figure" aria-label=${t('figures')} value=${figure.id} onChange=${event => choose(event.currentTarget.value)}>${figures.map(({ id, title }) => html`<option value=${id}>${title.text}</option>`)}</select>
      <button type="button" class="icon" aria-label=${t('picture_after')} title=${t('picture_after')} onClick=${() => go(1)}>›</button>
      <span class="quiet">${at + 1} / ${figures.length}</span>
    </div>`;
}

/** Warnings; of many the first few until all are asked for, and all on paper. */
export function Warnings({ list, names }) {
  const [asked, setAsked] = useState(list.length <= FEW_WARNINGS + 1);
  const isPrinting = usePrinting();
  const whole = asked || isPrinting;
  if (list.length === 0) return null;
  return html`
    <ul class="warnings" aria-label=${t('warnings')}>${(whole ? list : list.slice(0, FEW_WARNINGS)).map(({ code, detail, pointer }, index) => html`<li key=${code + pointer + index}><span class="sign" aria-hidden="true">!</span><span>${capital(spoken(detail, names))}</span></li>`)}</ul>
    ${!whole && html`<button type="button" class="more" onClick=${() => setAsked(true)}>${t('and_more', { count: list.length - FEW_WARNINGS })}</button>`}`;
}

export const short = text => text.split(/[:;,(–]/)[0].trim();

/** The extended model of a diagnosis, under a name of the user's own. */
function SaveModel({ resultKey, stale, owns }) {
  const [name, setName] = useState('');
  const [done, setDone] = useState(null);
  const [trouble, setTrouble] = useState(null);
  const keep = async event => {
    event.preventDefault();
    setTrouble(null);
    if (!owns(resultKey)) return;
    try {
      setDone(await api.saveModel(name, { from_result: resultKey }));
    } catch (error) {
      setTrouble(error.problem?.errors?.[0]?.detail || error.problem?.detail || error.message);
    }
  };
  return html`
    <form class="bar save-model" onSubmit=${keep}>
      <label for="model-name">${t('save_model')}</label>
      <input id="model-name" type="text" value=${name} placeholder="lathe-7-winter" pattern="[a-z0-9][a-z0-9_\\-]{0,63}" required onInput=${event => setName(event.currentTarget.value)} aria-describedby="model-name-hint" />
      <button type="submit" class="primary" disabled=${stale}>${t('save')}</button>
      <span class="quiet" id="model-name-hint">${done ? html`${t('model_saved', { name: done.name, revision: done.revision })} <a href="#/models">${t('models')}</a>` : t('model_name_hint')}</span>
      ${trouble && html`<p class="fault" role="alert"><span>${trouble}</span></p>`}
    </form>`;
}
