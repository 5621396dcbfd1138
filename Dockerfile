# Lapwing's images: `runtime` (every service, the launcher, replay), `foxglove` (shows a flight), `cluster` (campaigns on
# Dask) and `tests`.
#
#   make docker-build            also where no image can be pulled and no package index is reached from a container
#   docker compose build         where both can
#
# BASE is any image with Debian bookworm, Python 3.11 with pip, and passwd; deploy/base-image.sh makes one. Debian's
# release is part of the numbers: the kernels call its mathematical library. Written so that the classic builder of
# older engines takes it too: no mounts, no here-documents.
ARG BASE=python:3.11-slim-bookworm
# An earlier image, whose kernels are taken where nothing of them has changed; deploy/build.sh names it.
ARG PREVIOUS
# An image with the pinned wheels in /wheels (deploy/wheels.sh): in the context they would be sent again for each image.
ARG WHEELS


FROM ${PREVIOUS:-${BASE}} AS previous


FROM ${WHEELS:-${BASE}} AS wheels


FROM ${BASE} AS dependencies
# Where pip looks, without such wheels; only in this stage, of which no layer is shipped.
ARG PIP_INDEX_URL
ARG PIP_EXTRA_INDEX_URL
ARG PIP_TRUSTED_HOST
ENV PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_CACHE_DIR=1 PIP_ROOT_USER_ACTION=ignore
COPY deploy/requirements*.lock /build/
COPY deploy/slim.py deploy/install.sh /build/
# The first file is in every image: one that has no wheels is no error.
COPY --from=wheels /etc/debian_version /wheel[s] /build/
RUN /build/install.sh


# What does not change with the sources comes first: each step after the first that has changed costs an older engine
# seconds, whatever it does.
FROM ${BASE} AS packages
# Machine code for a fixed kind of processor, so that the kernels warmed here are found on every machine. Scalar code
# is as fast as the host's own kind; the numbers are the same bits. On ARM: --build-arg NUMBA_CPU_NAME=generic.
ARG NUMBA_CPU_NAME=x86-64-v3
ENV PATH=/opt/lapwing/bin:$PATH \
    NUMBA_CPU_NAME=${NUMBA_CPU_NAME} \
    NUMBA_CPU_FEATURES= \
    LAPWING_CACHE=/var/cache/lapwing \
    MPLCONFIGDIR=/var/cache/lapwing/matplotlib \
    HOME=/tmp \
    PYTHONUNBUFFERED=1
RUN useradd --uid 1000 --home-dir /app --no-create-home --shell /usr/sbin/nologin lapwing
COPY --from=dependencies /opt/lapwing /opt/lapwing
WORKDIR /app
ENTRYPOINT ["entrypoint.sh"]
CMD ["lapwing", "--help"]


FROM packages AS built
COPY . /build/
# Likewise where there are no kernels.
COPY --from=previous /etc/debian_version /var/cache/lapwin[g] /var/cache/lapwing/
RUN /build/deploy/built.sh


FROM packages AS runtime
USER lapwing
COPY --from=built /image/ /


FROM packages AS cluster
USER lapwing
COPY --from=dependencies /opt/lapwing-cluster /opt/lapwing-cluster
ENV PYTHONPATH=/opt/lapwing-cluster
COPY --from=built /image/ /


FROM packages AS foxglove
USER lapwing
COPY --from=dependencies /opt/lapwing-foxglove /opt/lapwing-foxglove
ENV PYTHONPATH=/opt/lapwing-foxglove
COPY --from=built /image/ /


FROM packages AS test-packages
COPY --from=dependencies /opt/lapwing-tests /opt/lapwing-tests
ENV PYTHONPATH=/opt/lapwing-tests PYTHONDONTWRITEBYTECODE=1
CMD ["python", "-m", "pytest", "-p", "no:cacheprovider"]
USER lapwing
COPY benchmarks benchmarks
COPY deploy deploy
COPY docs docs
COPY examples examples
COPY .dockerignore .gitignore CHANGELOG.m[d] CONTRIBUTING.m[d] Dockerfile Makefile docker-compose*.yml ./
COPY tests tests


FROM test-packages AS tests
COPY --from=built /image/ /


# What `docker build .` gives.
FROM runtime
