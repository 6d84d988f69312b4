// The viewer: images of one view, flipped through, split, or side by side, all zoomed and moved together.

const LAYOUTS = [['one', 'One'], ['split', 'Split'], ['all', 'Side by side']];
const SHOWS = [
  ['image', 'Image', 'The image at this exposure'],
  ['absolute', 'Absolute error', 'Mean over the channels of |I − R|, R being the reference'],
  ['relative', 'Relative error', `(I − R) / √(R² + ${constants.epsilon}) of the luminance, R being the reference`],
  ['flip', 'FLIP', 'HDR-FLIP: the difference as a person sees it who flips between image and reference'],
];
const EXPOSURE_RANGE = 8;   // stops, up and down
const EXPOSURE_STEP = 0.5;  // stops, of the keys
const ZOOM_STEP = 1.25;
const MIDDLE_GREY = 0.18;

const HELP = [
  ['1 – 9', 'choose a picture'], ['← →', 'previous, next picture'], ['r', 'the reference, and back'],
  ['s', 'split: before and after'], ['g', 'all side by side'], ['d', 'image, errors, FLIP in turn'],
  ['e E', 'exposure: half a stop down, up'], ['+ − 0', 'zoom in, out, fit'], ['Shift + arrows', 'move'],
  ['f', 'large, and back'], ['wheel', 'zoom, once the viewer is clicked; before that with Ctrl'],
  ['drag', 'move'], ['double click', 'fit'], ['pinch, swipe', 'zoom, flip through'],
];

const viewers = [];

class Viewer {
  constructor(section) {
    this.section = section;
    this.set = JSON.parse(section.querySelector('.viewer-data').textContent);
    this.pictures = this.set.pictures;
    this.state = {
      current: 0, layout: 'one', show: 'image', exposure: this.set.exposure,
      against: this.set.reference ?? this.pictures.length - 1, before: 0,
    };
    this.layers = new Map();
  }

  async load() {
    const { width, height } = this.set;
    await Promise.all(this.pictures.map(async (picture) => {
      picture.linear = await decodeOnce(picture.pixels, (bytes) => unpackPixels(bytes, width, height, picture.scale));
      if (picture.flip) picture.flipError = await decodeOnce(picture.flip, (bytes) => bytes);
    }));
    this.truth = this.set.reference === null ? null : this.pictures[this.set.reference].linear;
    this.build();
    this.section.querySelector('.stills').hidden = true;
    this.section.querySelector('.stills').after(this.root);
    viewers.push(this);
    this.update();
  }

  // ---- the elements ------------------------------------------------------------------------------------------------

  build() {
    const button = (text, click, more = {}) => h('button', { type: 'button', click, ...more }, text);
    const group = (name, label, ...children) => h('div', { class: `group ${name}`, role: 'group', 'aria-label': label },
      ...children);

    this.choices = this.pictures.map((picture, k) => button(
      h('span', {}, k < 9 ? h('kbd', { 'aria-hidden': 'true' }, String(k + 1)) : '', picture.name),
      () => this.choose(k),
    ));
    const layouts = this.pictures.length > 1 ? LAYOUTS : LAYOUTS.slice(0, 1);
    this.layoutButtons = new Map(layouts.map(([name, text]) => (
      [name, button(text, () => this.apply({ layout: name }))])));
    const possible = { image: true, absolute: this.truth, relative: this.truth,
      flip: this.pictures.some((picture) => picture.flip) };
    this.showButtons = new Map(SHOWS.filter(([name]) => possible[name]).map(([name, text, title]) => (
      [name, button(text, () => this.apply({ show: name }), { title })])));

    this.exposure = h('input', {
      type: 'range', min: this.set.exposure - EXPOSURE_RANGE, max: this.set.exposure + EXPOSURE_RANGE, step: 0.25,
      'aria-label': 'Exposure in stops',
      input: () => this.apply({ exposure: +this.exposure.value }),
    });
    this.exposureText = h('output');
    this.zoomText = h('output', { 'aria-label': 'Size of a pixel' });
    this.against = h('select',
      { 'aria-label': 'Picture on the right', change: () => this.apply({ against: +this.against.value }) },
      ...this.pictures.map((picture, k) => h('option', { value: k }, picture.name)));
    this.againstGroup = h('label', { class: 'group against' }, 'right side ', this.against);
    this.largeButton = button('Large', () => this.enlarge(!this.large), { 'aria-pressed': 'false' });

    this.stage = new Stage(this.set.width, this.set.height, this);
    this.where = h('span', { class: 'where' });
    this.values = h('span', { class: 'values' });
    this.barStrip = h('span', { class: 'strip', role: 'img' });
    this.barTexts = [h('span'), h('span'), h('span')];
    this.bar = h('div', { class: 'colour-bar', hidden: true }, this.barStrip,
      h('span', { class: 'ends' }, ...this.barTexts));
    this.facts = h('p', { class: 'picture-facts' });
    this.said = h('p', { class: 'unseen', 'aria-live': 'polite' });

    const crops = this.set.crops.map((crop) => button(crop.name, () => this.stage.look(crop)));
    this.root = h('div', { class: 'viewer', role: 'group', 'aria-labelledby': this.set.titleId,
      focusout: (event) => {
        // Nothing of the page behind can be seen: whoever leaves by the keyboard goes back to it.
        if (this.large && event.relatedTarget && !this.root.contains(event.relatedTarget)) this.enlarge(false);
      } },
      group('pictures', 'Pictures', ...this.choices),
      h('div', { class: 'tools' },
        group('joined', 'Layout', ...this.layoutButtons.values()),
        this.againstGroup,
        this.showButtons.size > 1 ? group('joined', 'What is shown', ...this.showButtons.values()) : '',
        group('exposure', 'Exposure', h('span', { 'aria-hidden': 'true' }, 'Exposure'), this.exposure,
          this.exposureText,
          button('↺', () => this.apply({ exposure: this.set.exposure }), { 'aria-label': 'Reset exposure' })),
        group('zoom', 'Zoom', button('−', () => this.stage.zoomBy(1 / ZOOM_STEP), { 'aria-label': 'Zoom out' }),
          this.zoomText, button('+', () => this.stage.zoomBy(ZOOM_STEP), { 'aria-label': 'Zoom in' }),
          button('Fit', () => this.stage.fit()), this.largeButton),
        crops.length ? group('crops', 'Crops', h('span', {}, 'Look at'), ...crops) : ''),
      this.stage.element,
      h('div', { class: 'below' }, h('div', { class: 'readout' }, this.where, this.values), this.bar),
      this.facts,
      h('details', { class: 'help' }, h('summary', {}, 'Keys and gestures'),
        h('dl', {}, ...HELP.map(([keys, does]) => h('div', {}, h('dt', {}, keys), h('dd', {}, does))))),
      this.said);
  }

  // ---- what is shown -----------------------------------------------------------------------------------------------

  /** Change the state, and whatever depends on it. */
  apply(changes) {
    const was = { ...this.state };
    Object.assign(this.state, changes);
    this.state.exposure = clamp(this.state.exposure, +this.exposure.min, +this.exposure.max);
    if (was.exposure !== this.state.exposure || was.show !== this.state.show) this.layers.clear();
    this.update();
    this.announce();
  }

  /** Make picture `k` the current one. */
  choose(k) {
    if (k === this.state.current) return;
    this.apply({ current: k, before: this.state.current });
  }

  /** Go to the next picture, or with a negative step to the previous. */
  flip(step) {
    this.choose((this.state.current + step + this.pictures.length) % this.pictures.length);
  }

  announce() {
    const { current, layout, show, exposure, against } = this.state;
    const { name } = this.pictures[current], count = this.pictures.length;
    const what = layout === 'all' ? `${count} pictures side by side, ${name} chosen`
      : layout === 'split' ? `${name} beside ${this.pictures[against].name}` : `${name}, ${current + 1} of ${count}`;
    this.said.textContent = `${what}; ${SHOWS.find(([key]) => key === show)[1]}, exposure ${exposure.toFixed(2)}`;
  }

  /** Bring the elements in line with the state. */
  update() {
    const { current, layout, show, exposure, against } = this.state;
    const press = (element, on) => element.setAttribute('aria-pressed', String(on));
    this.choices.forEach((element, k) => press(element, k === current));
    this.layoutButtons.forEach((element, name) => press(element, name === layout));
    this.showButtons.forEach((element, name) => press(element, name === show));
    this.exposure.value = exposure;
    this.exposureText.textContent = `${exposure >= 0 ? '+' : '−'}${Math.abs(exposure).toFixed(2)}`;
    this.exposure.setAttribute('aria-valuetext', `${exposure.toFixed(2)} stops`);
    this.against.value = against;
    this.againstGroup.hidden = layout !== 'split';
    this.stage.element.dataset.layout = layout;

    this.stage.show(layout === 'all' ? [...this.pictures.keys()] : [current], this.pictures.map(({ name }) => name),
      current, layout === 'split' ? against : null);
    this.facts.replaceChildren(...Object.entries(this.pictures[current].facts).map(([name, value]) => (
      h('span', {}, h('b', {}, name), ` ${value}`))));
    this.updateBar();
  }

  /** Ends of the colour bar: they follow the exposure, as the picture does. */
  range() {
    const { show, exposure } = this.state;
    if (show === 'absolute') return [0, MIDDLE_GREY * 2 ** -exposure];
    const most = 0.5 * 2 ** (this.set.exposure - exposure);
    return show === 'relative' ? [-most, most] : [0, 1];
  }

  updateBar() {
    const { show } = this.state;
    this.bar.hidden = show === 'image';
    if (this.bar.hidden) return;
    const [low, high] = this.range().map(digits);
    const relative = show === 'relative';
    const anchors = (relative ? constants.signed : constants.magma).split(' ').map((hex) => `#${hex}`);
    this.barStrip.style.background = `linear-gradient(to right, ${anchors.join(', ')})`;
    const text = SHOWS.find(([name]) => name === show)[1];
    this.barStrip.setAttribute('aria-label', `${text}: colours from ${low} to ${high}`);
    const texts = relative ? [`${low} too dark`, '0', `+${high} too bright`]
      : [low, text, show === 'absolute' ? `${high} or more` : high];
    this.barTexts.forEach((element, k) => { element.textContent = texts[k]; });
  }

  /** What is shown of picture `k`, as a canvas of its own size. */
  layer(k) {
    if (this.layers.has(k)) return this.layers.get(k);
    const { width, height } = this.set;
    const canvas = h('canvas', { width, height });
    const context = canvas.getContext('2d');
    const image = context.createImageData(width, height);
    const { linear } = this.pictures[k];
    const [low, high] = this.range();
    const scaled = (value) => (value - low) / (high - low);
    if (this.state.show === 'image') tonemap(linear, this.state.exposure, image.data);
    else {
      const table = this.state.show === 'relative' ? signed : magma;
      colourMap(width * height, (i) => scaled(this.error(k, i)), table, image.data);
    }
    context.putImageData(image, 0, 0);
    this.layers.set(k, canvas);
    return canvas;
  }

  /** Linear red, green and blue of pixel `i` of picture `k`. */
  radiance(k, i) {
    return [...this.pictures[k].linear.subarray(3 * i, 3 * i + 3)];
  }

  /** The numbers behind the colour that is shown. */
  shownValues(k, i) {
    return this.state.show === 'image' ? this.radiance(k, i) : [this.error(k, i)];
  }

  /** The error that is shown, in pixel `i` of picture `k`; NaN where none is known. */
  error(k, i) {
    const { linear, flipError } = this.pictures[k];
    if (this.state.show === 'absolute') return absoluteError(linear, this.truth, i);
    if (this.state.show === 'relative') return relativeError(linear, this.truth, i);
    if (k === this.set.reference) return 0;
    return flipError ? flipError[i] / 255 : NaN;
  }

  /** Show the size of a pixel, and the values of the one that is pointed at, else of the one in the middle. */
  drawn() {
    const zoom = this.stage.scale(this.stage.panes[0]) / (devicePixelRatio || 1);
    this.zoomText.textContent = `${Math.round(100 * zoom)} %`;
    const { width, height } = this.set;
    const { probe } = this.stage;
    const x = clamp(Math.floor((probe ?? this.stage).x), 0, width - 1);
    const y = clamp(Math.floor((probe ?? this.stage).y), 0, height - 1);
    const i = y * width + x;
    const { layout, current, against, show } = this.state;
    const shown = layout === 'all' && probe ? probe.k : current;
    const ks = [...new Set([shown, ...(layout === 'split' ? [against] : []),
      ...(this.set.reference === null ? [] : [this.set.reference])])];
    const called = SHOWS.find(([name]) => name === show)[1];
    this.where.textContent = `${probe ? 'pixel' : 'middle pixel'} ${x}, ${y}`;
    this.values.replaceChildren(...ks.map((k) => {
      const rgb = this.radiance(k, i).map((value) => h('span', { class: 'rgb' }, digits(value)));
      const error = show !== 'image' && k !== this.set.reference
        ? [h('span', { class: 'error' }, `${called} ${digits(this.error(k, i))}`)] : [];
      return h('span', { class: 'value' }, h('b', {}, this.pictures[k].name), ...rgb, ...error);
    }));
  }

  // ---- size and keys ------------------------------------------------------------------------------------------------

  enlarge(large) {
    this.large = this.stage.large = large;
    this.root.classList.toggle('large', large);
    document.documentElement.classList.toggle('has-large', large);
    this.largeButton.setAttribute('aria-pressed', String(large));
    this.largeButton.textContent = large ? 'Close' : 'Large';
    if (large && !this.root.contains(document.activeElement)) this.stage.element.focus({ preventScroll: true });
    if (!large) this.root.scrollIntoView({ block: 'nearest' });
    this.stage.changed();
  }

  /** Whether the wheel is meant for the picture, and not for the page. */
  get attentive() {
    return this.large || this.root.contains(document.activeElement);
  }

  /** Act on a key; tells whether it was one of ours. */
  key(event) {
    const { state } = this;
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (arrows) {
      if (event.shiftKey) {
        const { width, height } = this.stage.panes[0].canvas;
        this.stage.moveBy(-arrows[0] * width / 10, -arrows[1] * height / 10);
      } else if (arrows[0]) this.flip(arrows[0]);
      return event.shiftKey || arrows[0] !== 0;
    }
    if (/^[1-9]$/.test(event.key)) {
      if (+event.key <= this.pictures.length) this.choose(+event.key - 1);
      return true;
    }
    const shows = [...this.showButtons.keys()];
    const toggle = (layout) => {
      if (this.layoutButtons.has(layout)) this.apply({ layout: state.layout === layout ? 'one' : layout });
    };
    const actions = {
      '+': () => this.stage.zoomBy(ZOOM_STEP),
      '=': () => this.stage.zoomBy(ZOOM_STEP),
      '-': () => this.stage.zoomBy(1 / ZOOM_STEP),
      0: () => this.stage.fit(),
      e: () => this.apply({ exposure: state.exposure - EXPOSURE_STEP }),
      E: () => this.apply({ exposure: state.exposure + EXPOSURE_STEP }),
      d: () => this.apply({ show: shows[(shows.indexOf(state.show) + 1) % shows.length] }),
      s: () => toggle('split'),
      g: () => toggle('all'),
      f: () => this.enlarge(!this.large),
      r: () => {
        if (this.set.reference === null) return;
        this.choose(state.current === this.set.reference ? state.before : this.set.reference);
      },
    };
    if (this.large) actions.Escape = () => this.enlarge(false);
    if (!Object.hasOwn(actions, event.key)) return false;
    actions[event.key]();
    return true;
  }
}

document.addEventListener('keydown', (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return;
  const field = event.target.closest?.('input, select');
  if (field && (event.key.startsWith('Arrow') || field.matches('select'))) return;
  const viewer = viewers.find((one) => one.large) ?? viewers.find((one) => one.root.contains(document.activeElement))
    ?? viewers.find((one) => one.root.matches(':hover'));
  if (viewer?.key(event)) event.preventDefault();
});

if ('DecompressionStream' in window) {
  // Pixels are decoded only for what comes near the screen.
  const near = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) {
      if (!isIntersecting) continue;
      near.unobserve(target);
      new Viewer(target).load().catch((error) => {
        console.error(error);
        target.append(h('p', { class: 'aside' }, 'The linear pixels cannot be read, so these are stills.'));
      });
    }
  }, { rootMargin: '600px 0px' });
  document.querySelectorAll('.images:has(.viewer-data)').forEach((section) => near.observe(section));
}
