#!/bin/sh
# The whole way of a light, from the rule of thumb to C and structured text; two CPU minutes.
# In the root of the repository: sh examples/traffic_light/run.sh FOLDER [Ingolstadt1-v0]
set -eu
OUT=$1
STEPS=${STEPS:-20000}
EPISODES=${EPISODES:-10}
LIGHT=${2:-Cologne1-v0}
WITH="--import examples.traffic_light"

case $LIGHT in
Ingolstadt1-v0) OTHER=west RULE=longest_queue ;;
*) OTHER=east-west RULE=max_wave ;;
esac
ALL="\"waiting for $OTHER\" + \"coming for $OTHER\""
MORE="more for $OTHER = $ALL - \"waiting for north-south\" - \"coming for north-south\""
ONE="always north-south when red for north-south >= 90"
TWO="always $OTHER when red for $OTHER >= 90 and red for north-south < 90"

echo "== A rule of thumb shows how the light can be run, and a tree does the same."
eutree record "$LIGHT" $WITH --expert examples.traffic_light:$RULE --episodes "$EPISODES" \
    --seed 1000 --out "$OUT/shown"
eutree fit "$OUT/shown" $WITH --derive "$MORE" --release-8 --episodes 5 --out "$OUT/shown.json"

echo "== It learns what is better."
eutree learn "$LIGHT" $WITH --derive "$MORE" --demos "$OUT/shown" --steps "$STEPS" --max-leaves 13 --seed 1000 \
    --evaluate-every 1000 --evaluation-episodes 5 --judge-episodes 0 --front-steps 0 \
    --out "$OUT/run"

echo "== Two rules stand above it, and are proven."
eutree edit "$OUT/run/policy.json" $WITH --enforce "$ONE" --enforce "$TWO" --episodes 5 \
    --out "$OUT/light.json"
eutree verify "$OUT/light.json" --property "$ONE" --property "$TWO"

echo "== It plays beside what else could run the light."
for RIVAL in longest_queue max_pressure max_wave; do
    eutree evaluate "$OUT/light.json" $WITH --episodes "$EPISODES" \
        --against "examples.traffic_light:$RIVAL"
done

echo "== It goes to the controller."
eutree show "$OUT/light.json"
eutree export "$OUT/light.json" --out "$OUT/light.svg"
eutree export "$OUT/light.json" --out "$OUT/light.c" --header --self-test
eutree export "$OUT/light.json" --format st --out "$OUT/light.st"
if command -v cc > /dev/null; then
    cc -std=c99 -Wall -O2 -o "$OUT/light_test" "$OUT/light.c" "$OUT/light_test.c"
    "$OUT/light_test" # asks on both sides of every threshold
fi
