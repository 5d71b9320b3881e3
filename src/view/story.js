// A pixel's story: what its ray met, sample by sample, and what the neurons did there.
View.Story = function (scene, saveAs) {
  var at = null, told = null, $ = View.$, busy = null;
  scene.layers.forEach(function (l, i) {
    if (l.neurons > 0) { $('story-layer').add(new Option(l.name, i)); }
  });
  $('story-layer').value = scene.layers.findIndex(function (l) { return l.name === 'C2'; });

  function table(s) {
    var rows = [['Step', 'Current', scene.layers[$('story-layer').value].name === s.layer ? 'Membrane' : '', 'Fires']];
    (s.sample ? s.sample.steps : []).forEach(function (t, i) { rows.push([i + 1, t.current, t.membrane, t.fires ? 'yes' : '-']); });
    var body = document.createElement('tbody'), head = document.createElement('thead');
    rows.forEach(function (row, i) {
      var tr = document.createElement('tr');
      row.forEach(function (cell, k) {
        var td = document.createElement(i && k ? 'td' : 'th');
        td.textContent = cell, td.className = k && k < 3 ? 'n' : '';
        tr.append(td);
      });
      (i ? body : head).append(tr);
    });
    $('story-steps').replaceChildren(head, body);
  }
  function rasters(s) {
    var all = [];
    scene.layers.forEach(function (l, i) {
      var drawing = s.drawings['raster-' + l.name];
      if (!drawing) { return; }
      var figure = document.createElement('figure'), plate = document.createElement('div'), text = document.createElement('figcaption');
      text.innerHTML = '<b></b>: neurons from top to bottom, samples and their steps from left to right. Click to choose a neuron.';
      text.firstChild.textContent = 'Spikes of ' + l.name;
      plate.className = 'plate', plate.innerHTML = drawing, plate.id = 'raster-' + l.name;
      plate.addEventListener('click', function (e) {
        var box = plate.firstElementChild.getBoundingClientRect();
        var column = Math.floor((e.clientX - box.left) / box.width * s.decoded.length * s.steps);
        $('story-layer').value = i;
        $('story-neuron').value = Math.min(l.neurons - 1, Math.max(0, Math.floor((e.clientY - box.top) / box.height * l.neurons)));
        $('story-sample').value = s.decoded[Math.max(0, Math.min(s.decoded.length - 1, Math.floor(column / s.steps)))];
        tell();
      });
      figure.append(text, plate);
      all.push(figure);
    });
    $('story-rasters').replaceChildren.apply($('story-rasters'), all);
  }
  function show(s) {
    told = s;
    $('story').hidden = false;
    View.put('story-title', 'Pixel ' + s.x + ', ' + s.y);
    var light = (100 * (1 - s.transmittance)).toFixed(1);
    View.put('story-lead', s.samples + ' samples at ' + s.steps + ' time steps, ' + light + ' % of the light from them; ' + View.count(s.spikes) +
      ' spikes, ' + View.count(s.sops) + ' SOP, ' + View.count(s.macs) + ' MAC, ' + View.energy(s.energy_fj) +
      ' in the paper ledger. R, G, B as the accelerator has them: ' + s.rgba.slice(0, 3).join(', ') + ' of 65535.');
    $('story-along').innerHTML = s.drawings.along;
    $('story-one').innerHTML = s.drawings.neuron;
    $('story-neuron').value = s.neuron;
    if (s.sample) { $('story-sample').value = s.sample.index; }
    table(s), rasters(s);
    $('story').dataset.milliseconds = s.milliseconds;
  }
  function tell() {
    if (!at) { return; }
    if (busy) { busy.abort(); }
    busy = new AbortController();
    var asked = Object.assign({}, at, { layer: $('story-layer').value, neuron: $('story-neuron').value || 0 });
    if ($('story-sample').value !== '') { asked.sample = $('story-sample').value; }
    return View.json('/story', asked, busy.signal).then(function (s) { View.problem(''); show(s); }).catch(View.told);
  }
  ['story-layer', 'story-neuron', 'story-sample'].forEach(function (id) { $(id).addEventListener('change', tell); });
  $('story-along').addEventListener('click', function (e) {
    var box = $('story-along').getBoundingClientRect(), n = told.decoded.length ? told.decoded[told.decoded.length - 1] : 0;
    $('story-sample').value = Math.max(0, Math.min(n, Math.round((e.clientX - box.left) / box.width * n)));
    tell();
  });
  $('story-replay').addEventListener('click', function () {
    saveAs('/replay', at, 'sf_cosim-replay.json').then(function () {
      View.put('story-hint', 'sf_cosim --replay sf_cosim-replay.json runs them through the accelerator.');
    }).catch(View.told);
  });
  return {
    open: function (asked) { at = asked, $('story-sample').value = ''; return tell(); },
    choose: function (layer, neuron, sample) { $('story-layer').value = layer, $('story-neuron').value = neuron, $('story-sample').value = sample; return tell(); }
  };
};
