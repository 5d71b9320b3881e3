// A difference of sf_cosim: where it is in the picture, what core and accelerator had, where to look further.
View.Difference = function (scene, choose, go, saveAs) {
  var $ = View.$;
  function rows(list, head) {
    var table = document.createElement('table'), body = document.createElement('tbody');
    table.className = 'narrow';
    [head].concat(list).forEach(function (row, i) {
      var tr = document.createElement('tr');
      row.cells.forEach(function (cell, k) {
        var td = document.createElement(i && k ? 'td' : 'th');
        td.textContent = cell, td.className = k ? 'n' : '';
        tr.append(td);
      });
      if (row.chosen) { tr.className = 'chosen'; }
      body.append(tr);
    });
    table.append(body);
    return table;
  }
  function text(tag, words) {
    var e = document.createElement(tag);
    e.textContent = words;
    return e;
  }
  function sides(f, d) {
    var where = [d.layer_name ? 'layer ' + d.layer_name : '', f.step >= 0 ? 'step ' + f.step + ' (from 0)' : '', f.neuron >= 0 ? 'neuron ' + f.neuron : ''];
    return rows([{ cells: [where.filter(Boolean).join(', ') || 'all', f.wire, f.expected, f.actual], chosen: true }],
      { cells: ['Where', 'What', 'Core, expected', 'Accelerator, actual'] });
  }
  function counters(c) {
    return rows(c.layers.map(function (l) {
      function sum(list) { return View.count((list || []).reduce(function (a, b) { return a + b; }, 0)); }
      return { cells: [l.name, sum(l.mac), sum(l.sop), sum(l.spikes)] };
    }), { cells: ['Core\u2019s counters', 'MAC', 'SOP', 'Spikes'] });
  }
  return View.json('/difference').then(function (d) {
    var f = d.file, body = $('difference-body');
    $('difference').hidden = false;
    View.put('difference-lead', f.in_the_run || 'The file tells of no difference.');
    body.append(text('p', 'In the replay of ' + d.samples + ' samples: ' + (f.in_the_replay || '-') +
      '. The accelerator in this program, on the same samples: ' + d.here + '.'));
    if (f.wire) { body.append(sides(f, d)); }
    if (d.drawing) {
      var figure = document.createElement('figure');
      figure.innerHTML = d.drawing, figure.style.maxWidth = '640px';
      body.append(figure);
      body.append(rows(d.neurons.map(function (n) {
        return { cells: [n.neuron, n.current, n.membrane, n.fires ? 'yes' : '-'], chosen: n.neuron === f.neuron };
      }), { cells: ['Core\u2019s neurons', 'Current', 'Membrane', 'Fires'] }));
    }
    body.append(counters(d.counts));
    if (d.wave) {
      var button = text('button', 'Save the signals that matter');
      button.id = 'difference-signals';
      button.addEventListener('click', function () { saveAs('/signals', {}, 'difference.gtkw').catch(View.told); });
      body.append(text('p', 'The waveform, around cycle ' + f.cycle + ', with the saved list of signals:'), text('pre', 'gtkwave ' + d.wave + ' difference.gtkw'), button);
    }
    if (scene.views && f.view >= 0) { go(f.view, function () { choose([f.x, f.y]); }); }
  }).catch(View.told);
};
