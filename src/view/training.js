// Training as it goes: asked once a second while the page is seen.
(function () {
  var seen = 0;
  function number(v, digits, unit) { return v === null || v === undefined ? '-' : v.toFixed(digits) + (unit || ''); }
  function left(s) {
    if (s === null) { return '-'; }
    return s >= 90 ? Math.round(s / 60) + ' min' : Math.round(s) + ' s';
  }
  function show(t) {
    View.problem('');
    View.put('where', t.stage === 0 ? 'not begun' : t.stage === 3 ? 'learned; the test views are evaluated' : 'stage ' + (t.stage === 1 ? 'I' : 'II'));
    View.$('progress').value = t.progress || 0;
    View.put('n-iteration', View.count(t.iteration));
    View.put('n-loss', t.loss === null ? '-' : t.loss.toPrecision(3));
    View.put('n-psnr', number(t.psnr, 2, ' dB'));
    View.put('n-t', t.t_star ? t.t_star.toFixed(2) + ' (t_r = ' + t.t_r + ')' : '-');
    View.put('n-quiet', t.quiet.join(', '));
    View.put('n-eta', left(t.eta));
    View.put('view', t.view || 'none');
    View.put('preview-psnr', t.preview_psnr === null ? '' : 'PSNR ' + t.preview_psnr.toFixed(2) + ' dB.');
    View.$('curves').innerHTML = t.curves || '';
    if (t.preview > seen) {
      seen = t.preview;
      View.$('preview').src = View.url('/preview', {});
      View.$('preview').hidden = false;
    }
  }
  function again() {
    if (document.hidden) { setTimeout(again, 1000); return; }
    View.json('/training').then(show, View.told).then(function () { setTimeout(again, 1000); });
  }
  again();
})();
