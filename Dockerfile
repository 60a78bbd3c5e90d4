# docker build -t epiline . && docker run --rm -v "$PWD:/data" -u "$(id -u)" epiline replay RECORDING --out out
FROM debian:bookworm-slim AS build
RUN apt-get update && apt-get install -y --no-install-recommends git ca-certificates
COPY . /epiline
RUN git config --global --add safe.directory /epiline && cd /epiline && ./run package

FROM debian:bookworm-slim
COPY --from=build /epiline/build/release/package/epiline_*.deb /tmp/
RUN apt-get update && apt-get install -y --no-install-recommends /tmp/epiline_*.deb && rm -rf /tmp/* /var/lib/apt/lists/*
WORKDIR /data
ENTRYPOINT ["epiline"]
CMD ["--help"]
