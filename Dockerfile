# Lapwing's images: `runtime` (every service, the launcher, replay, live views, campaigns on Dask) and `tests`.
#
#   make docker-build            also where no image can be pulled and no package index is reached from a container
#   docker compose build         where both can
#
# BASE is any image with Debian bookworm, Python 3.11 with pip, passwd and openssl; deploy/base-image.sh makes one.
# Written so that the classic builder of older engines takes it too: no mounts, no here-documents.
ARG BASE=python:3.11-slim-bookworm
# An image with the pinned wheels in /wheels (deploy/wheels.sh): in the context they would be sent again for each image.
ARG WHEELS


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
# The command, which finds the sources in /app.
COPY pyproject.toml README.md LICENSE ./
COPY --from=dependencies /opt/backend /opt/backend
RUN PYTHONPATH=/opt/backend pip --python /opt/lapwing/bin/python install --prefix /image/opt/lapwing --no-deps \
        --no-build-isolation --no-index --no-cache-dir --no-warn-script-location \
        --config-settings editable_mode=compat --editable . && \
    mkdir -p /image/app && cp -rp /image/opt/lapwing/. /opt/lapwing/
# With kernels of an earlier image, if deploy/build.sh has found one: what has not changed is not compiled again.
COPY . /build/
RUN /build/deploy/built.sh


FROM packages AS runtime
USER lapwing
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
COPY .dockerignore .gitignore CHANGELOG.m[d] CONTRIBUTING.m[d] Dockerfile Makefile docker-compose.yml ./
COPY tests tests


FROM test-packages AS tests
COPY --from=built /image/ /


# What `docker build .` gives.
FROM runtime
