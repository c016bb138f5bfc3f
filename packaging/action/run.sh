# Run every pipeline of $PIPELINES; collect the summaries. The exit code is the worst one: 0 good, 1 a check failed,
# 2 the input is at fault, 3 the program is.
set -u
folder="${RUNNER_TEMP:-${TMPDIR:-.}}/pneucli"
summary="$folder/summary.md"
mkdir -p "$folder"
echo "<!-- pneucli -->" > "$summary"
worst=0
found=no
# unquoted on purpose: the globs of $PIPELINES are expanded here
for pipeline in $PIPELINES; do
  [ -f "$pipeline" ] || continue
  found=yes
  out="$folder/$(echo "${pipeline%.toml}" | tr '/\\' '__')"
  status=0
  pneucli run "$pipeline" --out "$out" 2> "$folder/messages" || status=$?
  cat "$folder/messages" >&2
  printf '## %s\n\n' "$pipeline" >> "$summary"
  if [ -f "$out/report/summary.md" ] && [ "$status" -le 1 ]; then
    sed 's/^#/##/' "$out/report/summary.md" >> "$summary"
  else
    printf '```text\n' >> "$summary"
    tail -n 20 "$folder/messages" >> "$summary"
    printf '```\n' >> "$summary"
  fi
  printf '\n' >> "$summary"
  [ "$status" -gt "$worst" ] && worst=$status
done
if [ "$found" = no ]; then
  echo "error: no file $PIPELINES" | tee -a "$summary" >&2
  worst=2
fi
[ -z "${GITHUB_STEP_SUMMARY:-}" ] || cat "$summary" >> "$GITHUB_STEP_SUMMARY"
[ -z "${GITHUB_OUTPUT:-}" ] || printf 'summary=%s\nartifacts=%s\n' "$summary" "$folder" >> "$GITHUB_OUTPUT"
exit "$worst"
