// The page of a scene: its camera, its two pictures, what is saved of them.
View.json('/scene').then(function (scene) {
  var $ = View.$, state = { view: scene.views > 0 ? 0 : -1, share: 1, window: null, pixel: null, still: null, frames: [] };
  var home = new View.Camera(scene.camera, scene), camera = new View.Camera(scene.camera, scene);
  var sides = { left: new View.Side($('left'), scene.palette), right: new View.Side($('right'), scene.palette) };
  var story = View.Story(scene, saveAs), file = scene.scene.split('/').pop();
  View.put('title', file);
  View.put('subtitle', scene.data ? 'with ' + scene.data : 'without a data set');
  document.title = file + ' - spikefield';

  // ---- the controls' first state ----
  var sources = [['fixed', 'fixed point'], ['float', 'float model'], ['rtl', 'RTL, in a window'], ['photo', 'photograph']];
  ['left', 'right'].forEach(function (name) {
    sources.forEach(function (s) {
      var option = new Option(s[1], s[0]);
      option.disabled = (s[0] === 'float' && !scene.float) || (s[0] === 'photo' && !scene.views);
      $(name + '-source').add(option);
    });
    scene.maps.forEach(function (m) {
      var option = new Option(m.title + (m.unit === 'nJ' ? ' (energy)' : ''), m.key);
      option.disabled = (m.key === 'float-difference' && !scene.float) || (m.key === 'photo-difference' && !scene.views);
      $(name + '-map').add(option);
    });
    var steps = $(name + '-steps');
    steps.max = scene.steps_max, steps.value = scene.steps, View.put(name + '-steps-out', steps.value);
    steps.addEventListener('input', function () { View.put(name + '-steps-out', steps.value); still(0); });
    $(name + '-source').addEventListener('change', function () { still(0); });
    $(name + '-map').addEventListener('change', function () { still(0); });
  });
  $('view').max = Math.max(0, scene.views - 1);
  ['view', 'view-back', 'view-next'].forEach(function (id) { $(id).disabled = !scene.views; });

  // ---- pictures ----
  function map(name) { return $(name + '-map').value; }
  function source(name) { return $(name + '-source').value; }
  function where() { return state.view >= 0 && state.share === 1 ? { view: state.view } : { camera: camera.print(state.share) }; }
  function slow(name) { return source(name) === 'rtl' || map(name) === 'rtl-difference'; }
  function middle() {
    var s = camera.size(state.share), w = Math.min(16, s[0]), h = Math.min(16, s[1]);
    return [Math.floor((s[0] - w) / 2), Math.floor((s[1] - h) / 2), w, h];
  }
  function asked(name) {
    var a = where();
    a.source = source(name), a.steps = $(name + '-steps').value;
    if (map(name) !== 'none') { a.map = map(name); }
    if (slow(name)) { a.window = (state.window || middle()).join(','); }
    return a;
  }
  function shown() { return $('pair').checked ? ['left', 'right'] : ['left']; }
  function count(name, end) {
    $('legend-' + name).innerHTML = end.legend ? '<figure><figcaption></figcaption>' + end.legend + '</figure>' : '';
    if (end.legend) {
      var m = scene.maps.find(function (x) { return x.key === map(name); });
      $('legend-' + name).querySelector('figcaption').textContent = (shown().length > 1 ? name + ': ' : '') + m.title + ', ' + m.meaning;
    }
    if (name !== 'left') { return; }
    View.put('n-samples', end.samples === undefined ? '-' : View.count(end.samples));
    View.put('n-spikes', end.spikes === undefined ? '-' : View.count(end.spikes));
    View.put('n-sops', end.sops === undefined ? '-' : View.count(end.sops));
    View.put('n-energy', end.energy_fj === undefined ? '-' : View.energy(end.energy_fj));
    View.put('n-time', Math.round(end.milliseconds) + ' ms');
    if (end.wrong) { View.problem(end.wrong + ' pixels of the accelerator differ from the core: grey or white in the map.'); }
  }
  function full(name) {
    var a = asked(name);
    a.stride = sides[name].stride, a.finish = 1;
    $('stage').dataset[name] = 'busy';
    return sides[name].show(a, camera.size(state.share), function (end) {
      $('stage').dataset[name] = 'whole';
      count(name, end);
    }).catch(View.told);
  }
  // Every pixel, once nothing has moved for a while.
  function still(wait) {
    clearTimeout(state.still);
    state.still = setTimeout(function () {
      View.problem('');
      scene.maps.forEach(function (m) {
        ['left', 'right'].forEach(function (name) { if (m.key === map(name)) { View.put(name + '-meaning', m.key === 'none' ? '' : m.meaning); } });
      });
      if (!$('pair').checked) { sides.right.stop(); $('legend-right').textContent = ''; }
      shown().forEach(full);
    }, wait);
  }
  // One coarse frame at a time, as fast as they come.
  function frame() {
    if (state.drawing) { state.again = true; return; }
    state.drawing = true, state.again = false;
    var start = performance.now(), quick = shown().filter(function (n) { return !slow(n) && source(n) !== 'photo' && map(n) !== 'photo-difference'; });
    Promise.all(quick.map(function (name) {
      var a = asked(name);
      a.stride = sides[name].stride, a.finish = 0;
      $('stage').dataset[name] = 'busy';
      return sides[name].show(a, camera.size(state.share), function () {});
    })).then(function () {
      var ms = performance.now() - start;
      quick.forEach(function (name) { sides[name].adapt(ms); });
      state.frames.push(performance.now());
      while (state.frames[0] < performance.now() - 2000) { state.frames.shift(); }
      if (state.frames.length > 2) {
        var rate = 1000 * (state.frames.length - 1) / (state.frames[state.frames.length - 1] - state.frames[0]);
        $('stage').dataset.rate = rate.toFixed(1);
        View.put('n-time', rate.toFixed(0) + ' / s, every ' + (sides.left.stride === 1 ? 'pixel' : sides.left.stride + ' pixels'));
      }
    }).catch(View.told).then(function () {
      state.drawing = false;
      if (state.again) { frame(); }
    });
  }
  function moved() {
    if (state.view >= 0) {
      state.view = -1;
      View.put('view-name', 'free camera');
      ['left', 'right'].forEach(function (name) {
        if (source(name) === 'photo') { $(name + '-source').value = 'fixed'; }
        if (map(name) === 'photo-difference') { $(name + '-map').value = 'none'; }
      });
    }
    mark(null);
    still(180);
    frame();
  }

  // ---- views ----
  function go(index, then) {
    index = (index + scene.views) % scene.views;
    View.json('/view', { view: index }).then(function (v) {
      camera = new View.Camera(v.camera, scene), home = new View.Camera(v.camera, scene);
      state.view = index, $('view').value = index;
      View.put('view-name', v.name);
      mark(null), still(0);
      if (then) { then(); }
    }).catch(View.told);
  }
  $('view').addEventListener('change', function () { go(Number($('view').value) || 0); });
  $('view-back').addEventListener('click', function () { go(Number($('view').value) - 1); });
  $('view-next').addEventListener('click', function () { go(Number($('view').value) + 1); });
  $('share').addEventListener('change', function () {
    state.share = Number($('share').value), state.window = null;
    frameWindow(), mark(null), still(0);
  });
  function back() {
    if (scene.views) { go(Number($('view').value)); return; }
    camera = new View.Camera(scene.camera, scene), still(0);
  }

  // ---- the pointer ----
  var stage = $('stage'), pointers = new Map(), press = null;
  function pixel(e) {
    var box = stage.getBoundingClientRect(), s = camera.size(state.share);
    return [Math.max(0, Math.min(s[0] - 1, Math.floor((e.clientX - box.left) / box.width * s[0]))),
      Math.max(0, Math.min(s[1] - 1, Math.floor((e.clientY - box.top) / box.height * s[1])))];
  }
  function scale() { return camera.size(state.share)[0] / stage.getBoundingClientRect().width / state.share; }
  function spread() {
    var p = Array.from(pointers.values());
    return { x: (p[0].x + p[1].x) / 2, y: (p[0].y + p[1].y) / 2, d: Math.hypot(p[0].x - p[1].x, p[0].y - p[1].y) };
  }
  stage.addEventListener('contextmenu', function (e) { e.preventDefault(); });
  stage.addEventListener('pointerdown', function (e) {
    stage.setPointerCapture(e.pointerId);
    pointers.set(e.pointerId, { x: e.clientX, y: e.clientY });
    if (pointers.size === 1) { press = { x: e.clientX, y: e.clientY, from: pixel(e), far: false, pan: e.shiftKey || e.button > 0 }; }
    if (pointers.size === 2) { press = { two: spread(), far: true }; }
  });
  stage.addEventListener('pointermove', function (e) {
    var last = pointers.get(e.pointerId), now = { x: e.clientX, y: e.clientY };
    if (!last) { hover(pixel(e)); return; }
    var dx = now.x - last.x, dy = now.y - last.y;
    pointers.set(e.pointerId, now);
    if (press.two && pointers.size === 2) {
      var s = spread();
      camera.pan((s.x - press.two.x) * scale(), (s.y - press.two.y) * scale());
      if (s.d > 10) { camera.zoom(press.two.d / s.d); }
      press.two = s, moved();
      return;
    }
    if (press.two || !dx && !dy) { return; }
    if (Math.hypot(now.x - press.x, now.y - press.y) > 4) { press.far = true; }
    if (!press.far) { return; }
    if (state.windowing) { windowTo(press.from, pixel(e)); return; }
    if (press.pan) { camera.pan(dx * scale(), dy * scale()); } else { camera.orbit(dx * 0.007, dy * 0.007); }
    moved();
  });
  function release(e) {
    if (!pointers.delete(e.pointerId) || pointers.size) { return; }
    if (state.windowing && press.far) { windowing(false); still(0); } else if (!press.far && e.type === 'pointerup') { choose(pixel(e)); }
    press = null;
  }
  stage.addEventListener('pointerup', release);
  stage.addEventListener('pointercancel', release);
  stage.addEventListener('wheel', function (e) {
    e.preventDefault();
    camera.zoom(Math.exp(Math.max(-0.3, Math.min(0.3, e.deltaY * 0.0012))));
    moved();
  }, { passive: false });
  function hover(p) {
    var side = sides.left, text = 'Pixel ' + p.join(', ');
    if (side.values && map('left') !== 'none') {
      var v = side.values[p[1] * side.canvas.width + p[0]];
      var m = scene.maps.find(function (x) { return x.key === map('left'); });
      text += v === v ? ': ' + Number(v.toPrecision(6)) + ' ' + m.unit : ': no value';
    }
    View.put('hover', text);
  }

  // ---- a pixel, a window ----
  function percent(v, n) { return (100 * v / n) + '%'; }
  function mark(p) {
    var s = camera.size(state.share);
    state.pixel = p, $('cross').hidden = !p;
    if (p) { $('cross').style.left = percent(p[0] + 0.5, s[0]), $('cross').style.top = percent(p[1] + 0.5, s[1]); }
  }
  function choose(p) {
    mark(p);
    var a = where();
    a.x = p[0], a.y = p[1], a.steps = $('left-steps').value;
    return story.open(a);
  }
  function frameWindow() {
    var w = state.window, s = camera.size(state.share), f = $('frame').style;
    $('frame').hidden = !w;
    View.put('window-out', w ? w.join(', ') : '');
    if (w) { f.left = percent(w[0], s[0]), f.top = percent(w[1], s[1]), f.width = percent(w[2], s[0]), f.height = percent(w[3], s[1]); }
  }
  // At most 64 x 64 pixels: they take a while.
  function windowTo(a, b) {
    var x = Math.min(a[0], b[0]), y = Math.min(a[1], b[1]);
    state.window = [x, y, Math.min(64, Math.abs(a[0] - b[0]) + 1), Math.min(64, Math.abs(a[1] - b[1]) + 1)];
    frameWindow();
  }
  function windowing(on) {
    state.windowing = on;
    $('draw-window').setAttribute('aria-pressed', on);
    stage.classList.toggle('drawing', on);
  }
  $('draw-window').addEventListener('click', function () { windowing(!state.windowing); });

  // ---- two pictures ----
  $('pair').addEventListener('change', function () {
    var on = $('pair').checked;
    $('pair-controls').hidden = $('curtain').hidden = $('divider-row').hidden = !on;
    still(0);
  });
  $('divider').addEventListener('input', function () {
    var at = $('divider').value + '%';
    $('curtain').style.clipPath = 'inset(0 0 0 ' + at + ')';
    $('curtain').style.setProperty('--at', at);
  });

  // ---- keys ----
  function step(by) {
    var s = $('left-steps');
    s.value = Number(s.value) + by;
    s.dispatchEvent(new Event('input'));
  }
  stage.addEventListener('keydown', function (e) {
    var arrow = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[e.key], s = camera.size(state.share);
    if (e.ctrlKey || e.metaKey) { return; }
    if (arrow && e.altKey) {
      var p = state.pixel || [Math.floor(s[0] / 2), Math.floor(s[1] / 2)];
      mark([Math.max(0, Math.min(s[0] - 1, p[0] + arrow[0])), Math.max(0, Math.min(s[1] - 1, p[1] + arrow[1]))]);
      hover(state.pixel);
    } else if (arrow && e.shiftKey) { camera.pan(-20 * arrow[0], -20 * arrow[1]), moved(); }
    else if (arrow) { camera.orbit(0.08 * arrow[0], 0.08 * arrow[1]), moved(); }
    else if (e.key === '+' || e.key === '=') { camera.zoom(0.9), moved(); }
    else if (e.key === '-') { camera.zoom(1 / 0.9), moved(); }
    else if (e.key === '[' || e.key === ']') { step(e.key === '[' ? -1 : 1); }
    else if ((e.key === 'n' || e.key === 'p') && scene.views) { go(Number($('view').value) + (e.key === 'n' ? 1 : -1)); }
    else if (e.key === 'Home') { back(); }
    else if (e.key === 'Enter') { choose(state.pixel || [Math.floor(s[0] / 2), Math.floor(s[1] / 2)]); }
    else { return; }
    e.preventDefault();
  });

  // ---- saving ----
  function saveAs(path, a, name) {
    return View.ask(path, a).then(function (r) { return r.blob(); }).then(function (blob) {
      var link = document.createElement('a');
      link.href = URL.createObjectURL(blob), link.download = name;
      link.click();
      setTimeout(function () { URL.revokeObjectURL(link.href); }, 60000);
    });
  }
  function wanted(kind) {
    var a = asked('left');
    delete a.map;
    if (a.source !== 'rtl') { delete a.window; }
    a.kind = kind;
    return a;
  }
  ['exr', 'png'].forEach(function (kind) {
    $('save-' + kind).addEventListener('click', function () {
      saveAs('/save', wanted(kind), 'golden.' + kind).then(function () { View.problem(''); }, View.told);
    });
  });
  $('save-command').addEventListener('click', function () {
    View.ask('/save', wanted('command')).then(function (r) { return r.text(); }).then(function (text) {
      $('command').hidden = false;
      View.put('command', text);
      if (navigator.clipboard) { navigator.clipboard.writeText(text).catch(function () {}); }
    }).catch(View.told);
  });

  View.viewer = { camera: function () { return camera; }, story: story, go: go };
  if (scene.difference) { View.Difference(scene, choose, go, saveAs); }
  else if (scene.views) { View.json('/view', { view: 0 }).then(function (v) { View.put('view-name', v.name); }); }
  still(0);
}).catch(View.told);
