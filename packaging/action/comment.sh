# Write the summaries into one comment of the pull request: the one of the last run is replaced.
set -eu
gh pr comment "$PULL_REQUEST" --body-file "$SUMMARY" --edit-last --create-if-none
