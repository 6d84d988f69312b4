// The viewer: images of one view, flipped through, split, or side by side, all zoomed and moved together.

const LAYOUTS = [['one', 'One'], ['split', 'Split'], ['all', 'Side by side']];
const SHOWS = [
  ['image', 'Image', 'The image at this exposure'],
  ['absolute', 'Absolute error', 'Mean over the channels of |I − R|, R being the reference'],
  ['relative', 'Relative error', '(I − R) / √(R² + 0.01) of the luminance; its square is the relative MSE'],
  ['flip', 'FLIP', 'HDR-FLIP: the difference as a person sees it who flips between image and reference'],
];
const EXPOSURE_STEP = 0.5;   // stops, of the keys
const ZOOM_STEP = 1.25;
const LARGEST_PIXEL = 96;    // CSS pixels, of one of the image's
const PIXEL_WITH_TEXT = 58;  // from this size on, pixels show their values
const MIDDLE_GREY = 0.18;
const SWIPE = 60;            // CSS pixels

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
      current: 0, layout: 'one', show: 'image', exposure: this.set.exposure, split: 0.5,
      against: this.set.reference ?? this.pictures.length - 1, before: 0,
      zoom: 1, x: this.set.width / 2, y: this.set.height / 2,
    };
    this.layers = new Map();
    this.panes = [];
    this.pointers = new Map();
    this.probe = null;
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
    new ResizeObserver(() => this.changed()).observe(this.stage);
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
    this.layoutButtons = new Map(layouts.map(([name, text]) => [name, button(text, () => this.apply({ layout: name }))]));
    const possible = { image: true, absolute: this.truth, relative: this.truth,
      flip: this.pictures.some((picture) => picture.flip) };
    this.showButtons = new Map(SHOWS.filter(([name]) => possible[name]).map(([name, text, title]) => (
      [name, button(text, () => this.apply({ show: name }), { title })])));

    this.exposure = h('input', {
      type: 'range', min: this.set.exposure - 8, max: this.set.exposure + 8, step: 0.25, 'aria-label': 'Exposure in stops',
      input: () => this.apply({ exposure: +this.exposure.value }),
    });
    this.exposureText = h('output', {});
    this.zoomText = h('output', { 'aria-label': 'Size of a pixel' });
    this.against = h('select', { 'aria-label': 'Picture on the right', change: () => this.apply({ against: +this.against.value }) },
      ...this.pictures.map((picture, k) => h('option', { value: k }, picture.name)));
    this.againstGroup = h('label', { class: 'group against' }, 'right side ', this.against);
    this.largeButton = button('Large', () => this.enlarge(!this.large), { 'aria-pressed': 'false' });

    this.hint = h('p', { class: 'hint', 'aria-hidden': 'true' }, 'Click first, or hold Ctrl, to zoom with the wheel');
    this.divider = h('div', {
      class: 'divider', role: 'slider', tabindex: 0, 'aria-label': 'Where the picture is split', 'aria-orientation': 'horizontal',
      'aria-valuemin': 0, 'aria-valuemax': 100, keydown: (event) => this.moveDivider(event),
    });
    this.stage = h('div', { class: 'stage', tabindex: 0, role: 'group', 'aria-label': 'Picture, moved and zoomed by keys' },
      this.divider, this.hint);
    this.listen();

    this.where = h('span', { class: 'where' });
    this.values = h('span', { class: 'values' });
    this.barStrip = h('span', { class: 'strip', role: 'img' });
    this.barTexts = [h('span'), h('span'), h('span')];
    this.bar = h('div', { class: 'colour-bar', hidden: true }, this.barStrip, h('span', { class: 'ends' }, ...this.barTexts));
    this.facts = h('p', { class: 'picture-facts' });
    this.said = h('p', { class: 'unseen', 'aria-live': 'polite' });

    const crops = this.set.crops.map((crop) => button(crop.name, () => this.look(crop)));
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
        group('exposure', 'Exposure', h('span', { 'aria-hidden': 'true' }, 'Exposure'), this.exposure, this.exposureText,
          button('↺', () => this.apply({ exposure: this.set.exposure }), { 'aria-label': 'Reset exposure' })),
        group('zoom', 'Zoom', button('−', () => this.zoomBy(1 / ZOOM_STEP), { 'aria-label': 'Zoom out' }), this.zoomText,
          button('+', () => this.zoomBy(ZOOM_STEP), { 'aria-label': 'Zoom in' }), button('Fit', () => this.fit()),
          this.largeButton),
        crops.length ? group('crops', 'Crops', h('span', {}, 'Look at'), ...crops) : ''),
      this.stage,
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
    this.state.exposure = clamp(this.state.exposure, this.set.exposure - 8, this.set.exposure + 8);
    if (was.exposure !== this.state.exposure || was.show !== this.state.show) this.layers.clear();
    this.update();
    this.announce();
  }

  choose(k) {
    if (k === this.state.current) return;
    this.apply({ current: k, before: this.state.current });
  }

  flip(step) {
    this.choose((this.state.current + step + this.pictures.length) % this.pictures.length);
  }

  announce() {
    const { current, layout, show, exposure, against } = this.state;
    const what = layout === 'all' ? `${this.pictures.length} pictures side by side, ${this.pictures[current].name} chosen`
      : layout === 'split' ? `${this.pictures[current].name} beside ${this.pictures[against].name}`
        : `${this.pictures[current].name}, ${current + 1} of ${this.pictures.length}`;
    this.said.textContent = `${what}; ${SHOWS.find(([name]) => name === show)[1]}, exposure ${exposure.toFixed(2)}`;
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
    this.againstGroup.hidden = this.divider.hidden = layout !== 'split';
    this.stage.dataset.layout = layout;

    const count = layout === 'all' ? this.pictures.length : 1;
    while (this.panes.length > count) this.panes.pop().element.remove();
    while (this.panes.length < count) {
      const canvas = h('canvas', { role: 'img' }), left = h('span', { class: 'name' }), right = h('span', { class: 'name right' });
      const element = h('div', { class: 'pane' }, canvas, left, right);
      this.stage.insertBefore(element, this.divider);
      this.panes.push({ element, canvas, context: canvas.getContext('2d'), left, right, k: 0 });
    }
    this.panes.forEach((pane, k) => {
      pane.k = layout === 'all' ? k : current;
      pane.element.classList.toggle('current', layout === 'all' && k === current);
      const name = this.pictures[pane.k].name, other = this.pictures[against].name;
      pane.left.textContent = name;
      pane.right.textContent = layout === 'split' ? other : '';
      pane.canvas.setAttribute('aria-label', layout === 'split' ? `${name} on the left, ${other} on the right` : name);
    });
    this.facts.replaceChildren(...Object.entries(this.pictures[current].facts).map(([name, value]) => (
      h('span', {}, h('b', {}, name), ` ${value}`))));
    this.updateBar();
    this.changed();
  }

  /** Ends of the colour bar: they follow the exposure, as the picture does. */
  range() {
    const { show, exposure } = this.state;
    if (show === 'absolute') return [0, MIDDLE_GREY * 2 ** -exposure];
    if (show === 'relative') return [-0.5 * 2 ** (this.set.exposure - exposure), 0.5 * 2 ** (this.set.exposure - exposure)];
    return [0, 1];
  }

  updateBar() {
    const { show } = this.state;
    this.bar.hidden = show === 'image';
    if (this.bar.hidden) return;
    const [low, high] = this.range();
    const anchors = (show === 'relative' ? constants.signed : constants.magma).split(' ').map((hex) => `#${hex}`);
    this.barStrip.style.background = `linear-gradient(to right, ${anchors.join(', ')})`;
    const text = SHOWS.find(([name]) => name === show)[1];
    this.barStrip.setAttribute('aria-label', `${text}: colours from ${digits(low)} to ${digits(high)}`);
    const sign = show === 'relative' ? '+' : '';
    this.barTexts[0].textContent = digits(low) + (show === 'relative' ? ' too dark' : '');
    this.barTexts[1].textContent = show === 'relative' ? '0' : text;
    this.barTexts[2].textContent = `${sign}${digits(high)}${show === 'relative' ? ' too bright' : show === 'absolute' ? ' or more' : ''}`;
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

  /** The error that is shown, in pixel `i` of picture `k`; NaN where none is known. */
  error(k, i) {
    const { linear, flipError } = this.pictures[k];
    if (this.state.show === 'absolute') return absoluteError(linear, this.truth, i);
    if (this.state.show === 'relative') return relativeError(linear, this.truth, i);
    if (k === this.set.reference) return 0;
    return flipError ? flipError[i] / 255 : NaN;
  }

  // ---- drawing -----------------------------------------------------------------------------------------------------

  /** Draw at the next frame, once. */
  changed() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.arrange();
      this.panes.forEach((pane) => this.draw(pane));
      this.read();
    });
  }

  /** Sizes of the panes and their canvases: as large as the place allows, in the shape of the image. */
  arrange() {
    const { width, height } = this.set;
    const count = this.panes.length;
    const wide = this.stage.clientWidth;
    const high = this.large ? this.stage.clientHeight : Infinity;
    let columns = 1;
    if (count > 1) {
      // As few columns as let all be seen at once; never so many that nothing is recognised.
      const tall = (n) => Math.ceil(count / n) * (wide / n) * height / width;
      while (columns < count && tall(columns) > Math.min(high, innerHeight * 0.9)) columns += 1;
      if (!this.large) columns = Math.max(1, Math.min(columns, Math.floor(wide / 160)));
    }
    this.stage.style.setProperty('--columns', columns);
    const rows = Math.ceil(count / columns);
    const paneWidth = (wide - 2 * (columns - 1)) / columns;
    const paneHeight = this.large ? (high - 2 * (rows - 1)) / rows
      : Math.min(paneWidth * height / width, Math.max(240, innerHeight * 0.75));
    const ratio = devicePixelRatio || 1;
    for (const { canvas } of this.panes) {
      canvas.style.height = `${paneHeight}px`;
      const size = [Math.round(paneWidth * ratio), Math.round(paneHeight * ratio)];
      // Setting a canvas's size clears it, so it is done only when needed.
      if (canvas.width !== size[0]) canvas.width = size[0];
      if (canvas.height !== size[1]) canvas.height = size[1];
    }
    this.keepInside();
    this.zoomText.textContent = `${Math.round(100 * this.scale(this.panes[0]) / ratio)} %`;
    this.divider.style.left = `${100 * this.state.split}%`;
    this.divider.setAttribute('aria-valuenow', Math.round(100 * this.state.split));
    // As long as all is seen, a finger scrolls the page.
    this.stage.style.touchAction = this.state.zoom > 1 || this.large ? 'none' : 'pan-y';
  }

  /** Device pixels of one of the image's. */
  scale({ canvas }) {
    return this.fitting(canvas) * this.state.zoom;
  }

  fitting(canvas) {
    return Math.min(canvas.width / this.set.width, canvas.height / this.set.height);
  }

  keepInside() {
    const { canvas } = this.panes[0];
    this.state.zoom = clamp(this.state.zoom, 1,
      Math.max(1, LARGEST_PIXEL * (devicePixelRatio || 1) / this.fitting(canvas)));
    const scale = this.scale(this.panes[0]);
    const inside = (centre, size, room) => (room / scale >= size ? size / 2
      : clamp(centre, room / 2 / scale, size - room / 2 / scale));
    this.state.x = inside(this.state.x, this.set.width, canvas.width);
    this.state.y = inside(this.state.y, this.set.height, canvas.height);
  }

  /** Device pixel of the canvas at which the image begins. */
  origin({ canvas }, scale) {
    return [Math.round(canvas.width / 2 - this.state.x * scale), Math.round(canvas.height / 2 - this.state.y * scale)];
  }

  draw(pane) {
    const { canvas, context } = pane;
    const scale = this.scale(pane), [x, y] = this.origin(pane, scale);
    const paint = (k) => {
      context.drawImage(this.layer(k), x, y, this.set.width * scale, this.set.height * scale);
      if (scale >= PIXEL_WITH_TEXT * (devicePixelRatio || 1)) this.drawValues(pane, k, scale, x, y);
    };
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.imageSmoothingEnabled = scale < 1;
    context.imageSmoothingQuality = 'high';
    paint(pane.k);
    if (this.state.layout === 'split') {
      const edge = Math.round(this.state.split * canvas.width);
      context.save();
      context.beginPath();
      context.rect(edge, 0, canvas.width - edge, canvas.height);
      context.clip();
      context.clearRect(edge, 0, canvas.width - edge, canvas.height);
      paint(this.state.against);
      context.restore();
    }
    if (this.probe && this.probe.marked) this.drawProbe(context, scale, x, y);
  }

  /** The pixel that a finger or the keyboard is at. */
  drawProbe(context, scale, x, y) {
    const size = Math.max(scale, 7);
    const left = x + (this.probe.x + 0.5) * scale - size / 2, top = y + (this.probe.y + 0.5) * scale - size / 2;
    for (const [grow, colour] of [[1, '#000'], [0, '#fff']]) {
      context.strokeStyle = colour;
      context.strokeRect(left - grow, top - grow, size + 2 * grow, size + 2 * grow);
    }
  }

  drawValues({ canvas, context }, k, scale, x, y) {
    const { width, height } = this.set;
    const step = scale / 4.4;
    context.font = `${Math.round(step * 0.82)}px ui-monospace, monospace`;
    context.textAlign = 'center';
    context.textBaseline = 'middle';
    context.lineWidth = 3;
    context.strokeStyle = '#000b';
    context.fillStyle = '#fff';
    for (let row = Math.max(0, Math.floor(-y / scale)); row < Math.min(height, (canvas.height - y) / scale); row++) {
      for (let column = Math.max(0, Math.floor(-x / scale)); column < Math.min(width, (canvas.width - x) / scale); column++) {
        const i = row * width + column;
        const lines = this.state.show === 'image' ? [0, 1, 2].map((c) => digits(this.pictures[k].linear[3 * i + c]))
          : [digits(this.error(k, i))];
        lines.forEach((line, n) => {
          const place = [x + (column + 0.5) * scale, y + (row + 0.5) * scale + (n - (lines.length - 1) / 2) * step];
          context.strokeText(line, ...place);
          context.fillText(line, ...place);
        });
      }
    }
  }

  // ---- the pixel under the cursor ----------------------------------------------------------------------------------

  /** Show the values of the probed pixel: that of the pointer, else the one in the middle. */
  read() {
    const { width, height } = this.set;
    const x = clamp(Math.floor(this.probe ? this.probe.x : this.state.x), 0, width - 1);
    const y = clamp(Math.floor(this.probe ? this.probe.y : this.state.y), 0, height - 1);
    const i = y * width + x;
    const { layout, current, against, show } = this.state;
    const shown = layout === 'all' && this.probe ? this.probe.k : current;
    const ks = [...new Set([shown, ...(layout === 'split' ? [against] : []),
      ...(this.set.reference === null ? [] : [this.set.reference])])];
    this.where.textContent = `${this.probe ? 'pixel' : 'middle pixel'} ${x}, ${y}`;
    this.values.replaceChildren(...ks.map((k) => {
      const rgb = [0, 1, 2].map((c) => h('span', { class: 'rgb' }, digits(this.pictures[k].linear[3 * i + c])));
      const error = show !== 'image' && k !== this.set.reference
        ? [h('span', { class: 'error' }, `${show} ${show === 'flip' ? '' : 'error '}${digits(this.error(k, i))}`)] : [];
      return h('span', { class: 'value' }, h('b', {}, this.pictures[k].name), ...rgb, ...error);
    }));
  }

  /** The pane under an event, the place in its canvas in device pixels, and the pixel of the image there. */
  placeOf(event) {
    const inside = (pane) => {
      const box = pane.canvas.getBoundingClientRect();
      return event.clientX >= box.left && event.clientX < box.right && event.clientY >= box.top && event.clientY < box.bottom;
    };
    const pane = this.panes.find(inside) ?? this.panes[0];
    const box = pane.canvas.getBoundingClientRect();
    const ratio = pane.canvas.width / box.width;
    const at = [(event.clientX - box.left) * ratio, (event.clientY - box.top) * ratio];
    const scale = this.scale(pane), [x, y] = this.origin(pane, scale);
    return { pane, at, ratio, x: Math.floor((at[0] - x) / scale), y: Math.floor((at[1] - y) / scale) };
  }

  probeAt(event) {
    const { pane, x, y } = this.placeOf(event);
    const inside = x >= 0 && y >= 0 && x < this.set.width && y < this.set.height;
    this.probe = inside ? { x, y, k: pane.k, marked: event.pointerType === 'touch' } : null;
  }

  // ---- zooming and moving ------------------------------------------------------------------------------------------

  /** Zoom by `factor`; what is at `at`, in device pixels of the canvas of `pane`, stays there. */
  zoomBy(factor, pane = this.panes[0], at = [pane.canvas.width / 2, pane.canvas.height / 2]) {
    const from = [at[0] - pane.canvas.width / 2, at[1] - pane.canvas.height / 2];
    const before = this.scale(pane), fitting = this.fitting(pane.canvas);
    const largest = Math.max(1, LARGEST_PIXEL * (devicePixelRatio || 1) / fitting);
    this.state.zoom = clamp(this.state.zoom * factor, 1, largest);
    const after = this.scale(pane);
    this.state.x += from[0] / before - from[0] / after;
    this.state.y += from[1] / before - from[1] / after;
    this.changed();
  }

  /** Move the image by device pixels. */
  moveBy(x, y, pane = this.panes[0]) {
    this.state.x -= x / this.scale(pane);
    this.state.y -= y / this.scale(pane);
    this.changed();
  }

  fit() {
    this.state.zoom = 1;
    this.changed();
  }

  /** Zoom to a rectangle. */
  look(crop) {
    const { canvas } = this.panes[0];
    const scale = Math.min(canvas.width / (crop.right - crop.left), canvas.height / (crop.bottom - crop.top));
    this.state.zoom = scale / this.fitting(canvas);
    this.state.x = (crop.left + crop.right) / 2;
    this.state.y = (crop.top + crop.bottom) / 2;
    this.said.textContent = `zoomed to ${crop.name}`;
    this.changed();
  }

  enlarge(large) {
    this.large = large;
    this.root.classList.toggle('large', large);
    document.documentElement.classList.toggle('has-large', large);
    this.largeButton.setAttribute('aria-pressed', String(large));
    this.largeButton.textContent = large ? 'Close' : 'Large';
    if (large && !this.root.contains(document.activeElement)) this.stage.focus({ preventScroll: true });
    if (!large) this.root.scrollIntoView({ block: 'nearest' });
    this.changed();
  }

  // ---- pointer, wheel and keys -------------------------------------------------------------------------------------

  listen() {
    const { stage } = this;
    stage.addEventListener('pointerdown', (event) => this.pointerDown(event));
    stage.addEventListener('pointermove', (event) => this.pointerMove(event));
    for (const end of ['pointerup', 'pointercancel']) stage.addEventListener(end, (event) => this.pointerUp(event));
    stage.addEventListener('pointerleave', (event) => {
      if (event.pointerType === 'touch') return;  // what was touched stays marked
      this.probe = null;
      this.changed();
    });
    stage.addEventListener('dblclick', () => this.fit());
    stage.addEventListener('wheel', (event) => {
      if (!event.ctrlKey && !this.large && !this.root.contains(document.activeElement)) {
        // The page scrolls on; whoever wants to zoom is told how.
        this.hint.classList.add('seen');
        clearTimeout(this.hintTimer);
        this.hintTimer = setTimeout(() => this.hint.classList.remove('seen'), 1500);
        return;
      }
      event.preventDefault();
      const { pane, at } = this.placeOf(event);
      const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 30 : 1;
      this.zoomBy(2 ** (-clamp(event.deltaY * lines, -200, 200) / 200), pane, at);
    }, { passive: false });
  }

  pointerDown(event) {
    if (event.button !== 0) return;
    const dividing = event.target === this.divider;
    event.target.setPointerCapture?.(event.pointerId);
    this.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY, from: event.clientX, dividing });
    this.pinched = this.pointers.size > 1;
    this.probeAt(event);
    if (this.state.layout === 'all' && this.probe) this.choose(this.probe.k);
    this.changed();
  }

  pointerMove(event) {
    const pointer = this.pointers.get(event.pointerId);
    if (!pointer) {
      this.probeAt(event);
      return this.changed();
    }
    const moved = [event.clientX - pointer.x, event.clientY - pointer.y];
    const { pane, ratio } = this.placeOf(event);
    const others = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, other]) => other);
    if (pointer.dividing) {
      const box = this.stage.getBoundingClientRect();
      this.state.split = clamp((event.clientX - box.left) / box.width, 0, 1);
    } else if (others.length) {
      const distance = (point) => Math.hypot(point.x - others[0].x, point.y - others[0].y);
      const now = { x: event.clientX, y: event.clientY };
      const middle = { clientX: (now.x + others[0].x) / 2, clientY: (now.y + others[0].y) / 2 };
      this.moveBy(moved[0] * ratio / 2, moved[1] * ratio / 2, pane);
      this.zoomBy(distance(now) / Math.max(1, distance(pointer)), pane, this.placeOf(middle).at);
    } else if (this.state.zoom > 1) {
      this.moveBy(moved[0] * ratio, moved[1] * ratio, pane);
    }
    Object.assign(pointer, { x: event.clientX, y: event.clientY });
    this.probeAt(event);
    this.changed();
  }

  pointerUp(event) {
    const pointer = this.pointers.get(event.pointerId);
    this.pointers.delete(event.pointerId);
    if (!pointer || event.type === 'pointercancel' || event.pointerType !== 'touch') return;
    const swiped = event.clientX - pointer.from;
    const flips = this.state.zoom === 1 && this.state.layout === 'one' && !this.pinched && Math.abs(swiped) > SWIPE;
    if (flips) this.flip(swiped < 0 ? 1 : -1);
  }

  moveDivider(event) {
    const step = { ArrowLeft: -0.02, ArrowRight: 0.02, Home: -1, End: 1 }[event.key];
    if (!step || event.shiftKey) return;
    event.preventDefault();
    event.stopPropagation();
    this.state.split = clamp(this.state.split + step, 0, 1);
    this.changed();
  }

  /** Act on a key; tells whether it was one of ours. */
  key(event) {
    const { state } = this;
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (arrows) {
      if (event.shiftKey) {
        const { width, height } = this.panes[0].canvas;
        this.moveBy(-arrows[0] * width / 10, -arrows[1] * height / 10);
      } else if (arrows[0]) this.flip(arrows[0]);
      else return false;
      return true;
    }
    if (/^[1-9]$/.test(event.key)) {
      if (+event.key <= this.pictures.length) this.choose(+event.key - 1);
      return true;
    }
    const shows = [...this.showButtons.keys()];
    const toggle = (layout) => this.layoutButtons.has(layout) && this.apply({ layout: state.layout === layout ? 'one' : layout });
    const actions = {
      '+': () => this.zoomBy(ZOOM_STEP), '=': () => this.zoomBy(ZOOM_STEP), '-': () => this.zoomBy(1 / ZOOM_STEP),
      0: () => this.fit(),
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
  document.querySelectorAll('.images').forEach((section) => section.querySelector('.viewer-data') && near.observe(section));
}
