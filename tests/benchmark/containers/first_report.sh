#!/usr/bin/env bash
# A whole train in containers on two hosts, from `railfix train up` to the first position report; and how large its images are.
#   tests/benchmark/containers/first_report.sh RIDE [docker]   (a folder of `railfix simulate`; root, after `./dev images`)
# With `docker` the hosts have an engine of Docker's each (apt-get install docker.io), which gets Podman's images.
# The hosts are two network namespaces with a cable between them; certificates and standby as in deploy/trains/re460-042.
set -euo pipefail
ride=$(readlink -f "${1:?"give a folder of railfix simulate"}") engine=${2:-podman}
cd "$(dirname "$(readlink -f "$0")")/../../.."
export PATH=$PWD/build/${RAILFIX_PRESET:-release}/bin:$PATH
[ -n "${CONTAINERS_CONF:-}" ] || [ ! -f /etc/containers/railfix-containers.conf ] ||
  export CONTAINERS_CONF=/etc/containers/railfix-containers.conf
release=$(sed -n 's/^project(railfix VERSION \([^ ]*\).*/\1/p' CMakeLists.txt)
work=$(mktemp -d) id=first-report-$$ engines=()

on() { # on HOST COMMAND...
  local host=$1
  shift
  # `ip netns exec` would hide the control groups from the engine
  DOCKER_HOST=unix://$work/$host.docker/socket nsenter --net="/run/netns/$id-$host" "$@"
}
images() { podman images --filter reference="railfix/*:$release" --format '{{.Repository}}:{{.Tag}}'; }
docker_on() { # HOST: an engine of its own, with our images; it leaves the network alone, as containers use the host's
  local host=$1 image
  mkdir -p "$work/$host.docker"
  on "$host" dockerd --iptables=false --ip6tables=false --bridge=none --host="unix://$work/$host.docker/socket" \
    --data-root="$work/$host.docker/data" --exec-root="$work/$host.docker/exec" --pidfile="$work/$host.docker/pid" \
    >"$work/$host.docker/log" 2>&1 &
  engines+=($!)
  for _ in $(seq 300); do on "$host" docker info >/dev/null 2>&1 && break || sleep 0.1; done
  for image in $(images); do
    podman save --quiet "$image" | on "$host" docker load >/dev/null
    on "$host" docker tag "$image" "${image#localhost/}"
  done
}
end() {
  for host in cab coach; do
    on "$host" railfix train down --root "$work/$host" >/dev/null || true
  done
  for host in cab coach; do
    [ "$engine" != docker ] || kill "$(cat "$work/$host.docker/pid")" || true
  done
  [ ${#engines[@]} = 0 ] || wait "${engines[@]}" || true
  for host in cab coach; do
    umount -l "$work/$host".docker/{exec/netns/default,data} 2>/dev/null || true # the engine leaves them mounted
    ip netns delete "$id-$host"
  done
  rm -rf "$work"
}
trap end EXIT
for host in cab coach; do ip netns add "$id-$host"; done
ip -n "$id-cab" link add train0 type veth peer name train1 netns "$id-coach"
ip -n "$id-cab" address add 10.42.1.11/24 dev train0
ip -n "$id-coach" address add 10.42.1.12/24 dev train1
for link in cab:train0 coach:train1 cab:lo coach:lo; do ip -n "$id-${link%:*}" link set "${link#*:}" up; done

# What a service reads lies where it runs.
mkdir -p "$work/train" "$work/cab/var/lib/railfix"
cp -rL "$ride/mav0" "$work/cab/var/lib/railfix/"
cp "$ride/map/line.map" "$work/train/"
cat >"$work/train/train.yaml" <<YAML
train:
  id: $id
  domain: 24
  release: $release
  run_as: $engine
  security: true
  map: line.map
  hosts:
    cab: { address: 10.42.1.11 }
    coach: { address: 10.42.1.12 }
  services:
    frame_grabber: cab
    sensor_gateway: cab
    track_detector: cab
    odometry: cab
    map_matcher: coach
    fusion: { host: coach, standby: cab }
    tpr_publisher: { host: coach, standby: cab }
    recorder: cab
    monitor: coach
settings:
  frame_grabber: { source: /var/lib/railfix, start: immediately }
  sensor_gateway: { source: /var/lib/railfix }
  fusion: { start: "1:100:+" }
  tpr_publisher: { nid_engine: 460042 }
  monitor: { foxglove_port: -1 }
YAML
railfix train keys "$work/train" >/dev/null
[ "$engine" != docker ] || for host in cab coach; do docker_on "$host"; done

began=$(date +%s.%N)
ups=()
since() { awk -v now="$(date +%s.%N)" -v began="$began" 'BEGIN { printf "%.1f s", now - began }'; }
for host in cab coach; do
  (on "$host" railfix train up "$work/train" --root "$work/$host" >"$work/$host.log" 2>&1 &&
    echo "$host: $(grep -c ' active\| ready\| degraded' "$work/$host.log") services healthy after $(since)" ||
    { echo "$host does not come up:"; cat "$work/$host.log"; }) &
  ups+=($!)
done
config=$work/coach/var/lib/railfix-train/generations/1/config.yaml
until [ -f "$config" ]; do
  kill -0 "${ups[@]}" 2>/dev/null || exit 1 # said above
  sleep 0.1
done
on coach railfix topics echo train_position_report --count 1 --for 600 --config "$config" >"$work/report"
echo "first position report, heard in the coach: $(since) after railfix train up"
cat "$work/report"
wait "${ups[@]}"
echo "images: each as it is listed, with the layers that it shares"
podman images --filter reference="railfix/*:$release" --format '{{.Repository}} {{.Size}}'
mapfile -t all < <(images)
podman save --quiet --multi-image-archive --output "$work/images.tar" "${all[@]}"
echo "all of them in one archive, each layer once: $(($(stat -c %s "$work/images.tar") / 1000000)) MB"
