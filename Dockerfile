# docker build -t boom . && docker run --rm -v "$PWD/output:/boom/boom/output" boom demo
FROM python:3.12-slim-bookworm
RUN apt-get update \
    && apt-get install -y --no-install-recommends build-essential git \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --create-home --home-dir /boom boom
USER boom
WORKDIR /boom/boom
# What the set-up needs first: a change of the code does not install the libraries again.
COPY --chown=boom boom pyproject.toml ./
COPY --chown=boom requirements requirements
COPY --chown=boom src src
RUN ./boom setup
COPY --chown=boom . .
RUN ./boom --version && ./boom check-machine tz17
ENTRYPOINT ["./boom"]
CMD ["--help"]
