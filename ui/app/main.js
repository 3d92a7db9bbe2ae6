// The shell: language, address, navigation, and what is said when something goes wrong.
import { html, render, useState, useEffect, useLayoutEffect, useRef, useCallback, Component } from './lib.js';
import { t, speak, language, languages, languageChanged } from './text.js';
import * as api from './api.js';
import { Room } from './room.js';
import { Study } from './study.js';
import { Home, Jobs, Results, Models } from './pages.js';
import { Library } from './library.js';
import { Processes } from './process.js';

const JOBS_LOOK_MS = 4000;
/** So many jobs of a state are counted. */
const MOST_COUNTED = 100;
const trouble = document.getElementById('trouble');

/** Whatever goes wrong in the page is said, not swallowed. */
function complain(error) {
  if (error?.name === 'AbortError') return;
  // A notice of the browser that a size settles one frame later.
  if (String(error?.message ?? error).startsWith('ResizeObserver loop')) return;
  const known = error instanceof api.Refused || error instanceof api.Unreachable;
  const words =
    t('page_trouble') === 'page_trouble'
      ? 'Something in this page failed. Reload it; if it happens again, tell those who run the service:'
      : t('page_trouble');
  trouble.textContent = known
    ? (error instanceof api.Refused && error.problem?.detail) || t('offline_detail')
    : `${words} ${error?.message || error}`;
  trouble.hidden = false;
  setTimeout(
    () => {
      trouble.hidden = true;
    },
    known ? 6000 : 30000,
  );
}
addEventListener('error', event => complain(event.error || event.message));
addEventListener('unhandledrejection', event => complain(event.reason));

/** A name of the address in plain letters. One that is no encoding of any stays as it is, and is the name of no page. */
function decoded(name) {
  try {
    return decodeURIComponent(name);
  } catch {
    return name;
  }
}

/** The page and the state in the address: `#/page?query`. */
function place() {
  const [path, query = ''] = location.hash.replace(/^#\/?/, '').split(/\?(.*)/s);
  return { page: decoded(path), query: new URLSearchParams(query) };
}

class Guard extends Component {
  constructor() {
    super();
    this.state = { error: null };
  }
  componentDidCatch(error) {
    this.setState({ error });
    complain(error);
  }
  render({ children }, { error }) {
    return error
      ? html`<main class="plain" id="main"><h1>${t('trouble_title')}</h1><p>${t('page_trouble')} ${error.message}</p><p><a href="#/" onClick=${() => this.setState({ error: null })}>${t('start_over')}</a></p></main>`
      : children;
  }
}

function useCell(cell) {
  const [value, set] = useState(cell.get());
  useEffect(() => cell.watch(set), [cell]);
  return value;
}

/** How many jobs wait or run, with a `+` where there are more than are counted; empty for none. */
async function openJobs() {
  // One after the other: a job that begins meanwhile is in both lists rather than in none.
  const queued = await api.jobs({ state: 'queued', limit: MOST_COUNTED });
  const running = await api.jobs({ state: 'running', limit: MOST_COUNTED });
  const count = new Set([...queued.items, ...running.items].map(({ id }) => id)).size;
  return count > 0 ? `${count}${queued.next || running.next ? '+' : ''}` : '';
}

function App() {
  const [{ page, query }, setPlace] = useState(place);
  const [calculators, setCalculators] = useState(null);
  const [models, setModels] = useState(null);
  const [running, setRunning] = useState('');
  const looks = useRef(0);
  const spoken = useCell(languageChanged);
  const isOnline = useCell(api.online);
  const needsKey = useCell(api.keyAsked);
  const [attempt, setAttempt] = useState(0);

  useEffect(() => {
    const move = () => setPlace(place());
    addEventListener('hashchange', move);
    addEventListener('popstate', move);
    return () => {
      removeEventListener('hashchange', move);
      removeEventListener('popstate', move);
    };
  }, []);
  useEffect(() => {
    api.patient(api.calculators).then(
      ({ items }) => setCalculators(items),
      error => {
        if (!(error instanceof api.Unreachable) && error.status !== 401) complain(error);
      },
    );
  }, [spoken, attempt, isOnline]);
  const refreshModels = useCallback(() => api.models().then(setModels, () => {}), []);
  useEffect(() => {
    refreshModels();
  }, [page, attempt, isOnline]);
  const refreshJobs = useCallback(async () => {
    looks.current += 1;
    const look = looks.current;
    try {
      const found = await openJobs();
      // What was asked before something else is not newer because it took longer.
      if (look === looks.current) setRunning(found);
    } catch {
      /* the count is of no use then, and the next look tells */
    }
  }, []);
  useEffect(() => {
    const look = () => {
      if (!document.hidden) refreshJobs();
    };
    refreshJobs();
    const timer = setInterval(look, JOBS_LOOK_MS);
    // What was not looked at while the page was hidden is long past.
    document.addEventListener('visibilitychange', look);
    return () => {
      clearInterval(timer);
      document.removeEventListener('visibilitychange', look);
    };
  }, [attempt, isOnline]);
  // While the service is away, it is asked now and then whether it is back.
  useEffect(() => {
    if (isOnline) return undefined;
    const timer = setInterval(() => api.alive().catch(() => {}), 2000);
    return () => clearInterval(timer);
  }, [isOnline]);

  const known = calculators?.find(({ id }) => id === page);
  useEffect(() => {
    const names = {
      studies: t('studies'),
      jobs: t('jobs'),
      results: t('results'),
      models: t('models'),
      processes: t('processes'),
      library: t('records'),
    };
    document.title = known ? `${known.title} – precut` : names[page] ? `${names[page]} – precut` : 'precut';
  }, [page, known, spoken]);
  const first = useRef(true);
  useEffect(() => {
    // A new page begins at its beginning, also for those who hear it.
    if (first.current) {
      first.current = false;
      return;
    }
    scrollTo(0, 0);
    document.getElementById('main')?.focus({ preventScroll: true });
  }, [page]);

  const to = (method, name) => next => {
    history[method](null, '', `#/${name}${next ? `?${next}` : ''}`);
    setPlace(place());
  };
  const push = useCallback(to('pushState', page), [page]);
  const replace = useCallback(to('replaceState', page), [page]);

  return html`
    <a class="skip" href="#main" onClick=${event => {
      event.preventDefault();
      document.getElementById('main')?.focus();
    }}>${t('skip')}</a>
    <${Header} ...${{ page, calculators, running, models, known }} />
    ${!isOnline && html`<p class="banner away" role="status">${t('offline_title')}. ${t('offline_detail')}</p>`}
    ${needsKey && html`<${KeyForm} key=${attempt} refused=${needsKey === 'refused'} done=${() => setAttempt(attempt + 1)} />`}
    <${Guard} key=${page}>
      <${Page} ...${{ page, query, calculators, known, needsKey, models, refreshModels, refreshJobs, push, replace, attempt, spoken }} />
    <//>`;
}

/** A page without a picture: a heading, and what is said. */
const plain = (heading, said) => html`<main class="plain" id="main" tabindex="-1">${heading && html`<h1>${heading}</h1>`}${said}</main>`;

/** What the address names. */
function Page({ page, query, calculators, known, needsKey, models, refreshModels, refreshJobs, push, replace, attempt, spoken }) {
  if (!calculators)
    return needsKey ? plain(t('slogan'), html`<p>${t('key_why')}</p>`) : plain(null, html`<p class="late">${t('loading')}</p>`);
  if (known) return html`<${Room} key=${`${page} ${attempt}`} id=${page} ...${{ query, push, replace, models, refreshJobs }} />`;
  switch (page) {
    case '':
      return html`<${Home} calculators=${calculators} />`;
    case 'jobs':
      return html`<${Jobs} calculators=${calculators} refreshJobs=${refreshJobs} />`;
    case 'results':
      return html`<${Results} calculators=${calculators} query=${query} replace=${replace} />`;
    case 'studies':
      return html`<${Study} key=${attempt} ...${{ calculators, query, push, replace, refreshJobs }} />`;
    case 'models':
      return html`<${Models} calculators=${calculators} models=${models} refreshModels=${refreshModels} />`;
    case 'processes':
      return html`<${Processes} key=${spoken} query=${query} />`;
    case 'library':
      return html`<${Library} key=${spoken} calculators=${calculators} models=${models} />`;
    default:
      return plain(t('no_page'), html`<p><a href="#/">${t('to_start')}</a></p>`);
  }
}

function Header({ page, calculators, running, models, known }) {
  const [open, setOpen] = useState(false);
  const menu = useRef(null);
  useEffect(() => {
    setOpen(false);
  }, [page]);
  useLayoutEffect(() => {
    if (!open) return undefined;
    const leave = event => {
      if (!menu.current?.contains(event.target)) setOpen(false);
    };
    const key = event => {
      if (event.key === 'Escape') {
        setOpen(false);
        menu.current?.querySelector('button')?.focus();
      }
    };
    addEventListener('pointerdown', leave);
    addEventListener('keydown', key);
    return () => {
      removeEventListener('pointerdown', leave);
      removeEventListener('keydown', key);
    };
  }, [open]);
  const link = (name, text, extra) => html`<a href=${`#/${name}`} aria-current=${page === name ? 'page' : undefined}>${text}${extra}</a>`;
  return html`
    <header class="shell">
      <a class="brand" href="#/" aria-label=${`precut, ${t('to_start')}`}><svg width="22" height="22" viewBox="0 0 32 32" aria-hidden="true"><path d="M3 21c7-8 19-8 26 0" fill="none" stroke="currentColor" stroke-width="3" stroke-linecap="round" /><path d="M3 21h26" stroke="currentColor" stroke-width="1.8" stroke-dasharray="3.5 2.6" opacity=".6" /><path d="M16 4l4 4.2-4 4.2-4-4.2z" fill="currentColor" /></svg><span>precut</span></a>
      <div class="ask" ref=${menu}>
        <button type="button" aria-expanded=${open} aria-controls="questions" onClick=${() => setOpen(!open)}><span>${known ? known.title : t('ask')}</span><span class="chevron" aria-hidden="true"></span></button>
        <nav id="questions" class="menu" hidden=${!open} aria-label=${t('calculators')}>
          ${(calculators || []).map(({ id, question, title }) => html`<a key=${id} href=${`#/${id}`} aria-current=${page === id ? 'page' : undefined} onClick=${() => setOpen(false)}><span>${question}</span><small>${title}</small></a>`)}
        </nav>
      </div>
      <nav class="places" aria-label=${t('places')}>
        ${link('studies', t('studies'))}
        ${link('jobs', t('jobs'), running && html`<span class="count"><span aria-hidden="true">${running}</span><span class="hidden">, ${running} ${t('open_jobs')}</span></span>`)}
        ${link('results', t('results'))}
        ${(models !== null || page === 'models') && link('models', t('models'))}
        ${link('processes', t('processes'))}
        <a href="/docs" class="docs-link">${t('docs')}</a>
      </nav>
      <div class="languages" role="group" aria-label=${t('language')}>
        ${languages.map(
          tag =>
            html`<button type="button" key=${tag} lang=${tag} aria-pressed=${language() === tag} onClick=${() =>
              speak(tag).catch(() =>
                api.alive().then(
                  () => location.reload(),
                  () => {},
                ),
              )}>${tag.toUpperCase()}</button>`,
        )}
      </div>
    </header>`;
}

/** The service is locked: it wants a key. */
function KeyForm({ done, refused }) {
  const [key, setKey] = useState('');
  useEffect(() => {
    document.getElementById('api-key')?.focus();
  }, []);
  return html`
    <form class="banner key-form" aria-label=${t('key_wanted')} onSubmit=${event => {
      event.preventDefault();
      api.useKey(key);
      done();
    }}>
      <label for="api-key">${t('key_wanted')}</label><input id="api-key" type="password" autocomplete="off" value=${key} aria-describedby="api-key-hint" aria-invalid=${refused ? 'true' : undefined} onInput=${event => setKey(event.currentTarget.value)} required /><button type="submit" class="primary">${t('use_key')}</button>
      ${refused && html`<span class="refused" role="alert">${t('key_refused')}</span>`}
      <span id="api-key-hint">${t('key_hint')}</span>
    </form>`;
}

// A file that falls beside its field must not take the place of the page.
for (const kind of ['dragover', 'drop'])
  addEventListener(kind, event => {
    if (!event.defaultPrevented) event.preventDefault();
  });
addEventListener('keydown', event => {
  if (event.key === 'Enter' && (event.ctrlKey || event.metaKey))
    /** @type {HTMLFormElement | null} */ (document.querySelector('.form'))?.requestSubmit();
});

const root = document.getElementById('app');
speak()
  .then(() => {
    root.textContent = '';
    render(html`<${App} />`, root);
  })
  .catch(complain);
