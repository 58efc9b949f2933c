--
-- PostgreSQL database dump
--


-- Dumped from database version 15.18 (Debian 15.18-0+deb12u1)
-- Dumped by pg_dump version 15.18 (Debian 15.18-0+deb12u1)

SET statement_timeout = 0;
SET lock_timeout = 0;
SET idle_in_transaction_session_timeout = 0;
SET client_encoding = 'UTF8';
SET standard_conforming_strings = on;
SELECT pg_catalog.set_config('search_path', '', false);
SET check_function_bodies = false;
SET xmloption = content;
SET client_min_messages = warning;
SET row_security = off;

SET default_tablespace = '';

SET default_table_access_method = heap;

--
-- Name: _sqlx_migrations; Type: TABLE; Schema: public; Owner: -
--

CREATE TABLE public._sqlx_migrations (
    version bigint NOT NULL,
    description text NOT NULL,
    installed_on timestamp without time zone DEFAULT CURRENT_TIMESTAMP NOT NULL,
    success boolean NOT NULL,
    checksum text NOT NULL,
    execution_time bigint NOT NULL
);


--
-- Name: assets; Type: TABLE; Schema: public; Owner: -
--

CREATE TABLE public.assets (
    hash text NOT NULL,
    size bigint NOT NULL,
    created_ms bigint NOT NULL
);


--
-- Name: checks; Type: TABLE; Schema: public; Owner: -
--

CREATE TABLE public.checks (
    id text NOT NULL,
    job text NOT NULL,
    round bigint NOT NULL,
    frame bigint NOT NULL,
    tile bigint NOT NULL,
    level bigint NOT NULL,
    idx bigint NOT NULL,
    lease text,
    second_lease text
);


--
-- Name: events; Type: TABLE; Schema: public; Owner: -
--

CREATE TABLE public.events (
    id bigint NOT NULL,
    kind text NOT NULL,
    job text NOT NULL,
    frame bigint,
    round bigint,
    created_ms bigint NOT NULL
);


--
-- Name: farm; Type: TABLE; Schema: public; Owner: -
--

CREATE TABLE public.farm (
    single bigint NOT NULL,
    id text NOT NULL,
    has_blobs bigint DEFAULT 0 NOT NULL,
    CONSTRAINT farm_single_check CHECK ((single = 1))
);


--
-- Name: job_assets; Type: TABLE; Schema: public; Owner: -
--

CREATE TABLE public.job_assets (
    job text NOT NULL,
    path text NOT NULL,
    hash text NOT NULL
);


--
-- Name: jobs; Type: TABLE; Schema: public; Owner: -
--

CREATE TABLE public.jobs (
    id text NOT NULL,
    name text NOT NULL,
    state text NOT NULL,
    failure text,
    priority bigint NOT NULL,
    scene text NOT NULL,
    scene_hash text NOT NULL,
    integrator text NOT NULL,
    missing_light text NOT NULL,
    frames bigint NOT NULL,
    width bigint NOT NULL,
    height bigint NOT NULL,
    tile_size bigint NOT NULL,
    samples_per_pass bigint NOT NULL,
    samples_per_block bigint NOT NULL,
    passes bigint NOT NULL,
    reference text,
    time_limit_ms bigint,
    created_ms bigint NOT NULL,
    started_ms bigint,
    finished_ms bigint,
    cursor_round bigint DEFAULT 0 NOT NULL,
    cursor_frame bigint DEFAULT 0 NOT NULL,
    cursor_tile bigint DEFAULT 0 NOT NULL,
    rounds bigint DEFAULT 0 NOT NULL,
    complete_passes bigint DEFAULT 0 NOT NULL,
    accepted_nodes bigint DEFAULT 0 NOT NULL,
    samples bigint DEFAULT 0 NOT NULL,
    core_ms bigint DEFAULT 0 NOT NULL,
    counters text DEFAULT '{"height_evaluations":0,"solver_calls":0,"converged":0,"unique_solutions":0,"trials":0,"truncated":0,"rays":0,"samples":0}'::text NOT NULL,
    target_mse double precision,
    target_estimated_mse double precision,
    stopped_by text,
    redone_nodes bigint DEFAULT 0 NOT NULL,
    probe_digest text,
    adaptive bigint DEFAULT 0 NOT NULL,
    shared_samples bigint
);


--
-- Name: keepers; Type: TABLE; Schema: public; Owner: -
--

CREATE TABLE public.keepers (
    job text NOT NULL,
    coordinator text NOT NULL,
    until_ms bigint NOT NULL
);


--
-- Name: leases; Type: TABLE; Schema: public; Owner: -
--

CREATE TABLE public.leases (
    id text NOT NULL,
    token bigint NOT NULL,
    job text NOT NULL,
    worker text NOT NULL,
    state text NOT NULL,
    nodes text NOT NULL,
    granted_ms bigint NOT NULL,
    deadline_ms bigint NOT NULL,
    patience_ms bigint DEFAULT 60000 NOT NULL,
    due_ms bigint DEFAULT 0 NOT NULL,
    gather_ms bigint DEFAULT 1000 NOT NULL
);


--
-- Name: nodes; Type: TABLE; Schema: public; Owner: -
--

CREATE TABLE public.nodes (
    job text NOT NULL,
    frame bigint NOT NULL,
    tile bigint NOT NULL,
    level bigint NOT NULL,
    idx bigint NOT NULL,
    first_pass bigint NOT NULL,
    end_pass bigint NOT NULL,
    blob text NOT NULL,
    blob_offset bigint DEFAULT 0 NOT NULL,
    blob_length bigint,
    counters text NOT NULL,
    builds text NOT NULL
);


--
-- Name: opinions; Type: TABLE; Schema: public; Owner: -
--

CREATE TABLE public.opinions (
    check_id text NOT NULL,
    worker text NOT NULL,
    digest text NOT NULL
);


--
-- Name: pending; Type: TABLE; Schema: public; Owner: -
--

CREATE TABLE public.pending (
    job text NOT NULL,
    round bigint NOT NULL,
    frame bigint NOT NULL,
    tile bigint NOT NULL,
    level bigint NOT NULL,
    idx bigint NOT NULL,
    failures bigint DEFAULT 0 NOT NULL,
    lease text,
    repeats bigint DEFAULT 0 NOT NULL,
    failed_by text
);


--
-- Name: rates; Type: TABLE; Schema: public; Owner: -
--

CREATE TABLE public.rates (
    worker text NOT NULL,
    job text NOT NULL,
    samples double precision NOT NULL,
    core_us double precision NOT NULL
);


--
-- Name: rounds; Type: TABLE; Schema: public; Owner: -
--

CREATE TABLE public.rounds (
    job text NOT NULL,
    frame bigint NOT NULL,
    round bigint NOT NULL,
    passes bigint NOT NULL,
    samples_per_pixel bigint NOT NULL,
    core_ms bigint NOT NULL,
    wall_ms bigint NOT NULL,
    recorded_ms bigint NOT NULL,
    mse double precision,
    corrected_mse double precision,
    rel_mse double precision,
    psnr double precision,
    estimated_mse double precision,
    flip double precision
);


--
-- Name: sequences; Type: TABLE; Schema: public; Owner: -
--

CREATE TABLE public.sequences (
    name text NOT NULL,
    value bigint NOT NULL
);


--
-- Name: tile_shares; Type: TABLE; Schema: public; Owner: -
--

CREATE TABLE public.tile_shares (
    job text NOT NULL,
    frame bigint NOT NULL,
    tile bigint NOT NULL,
    share bigint NOT NULL
);


--
-- Name: waves; Type: TABLE; Schema: public; Owner: -
--

CREATE TABLE public.waves (
    job text NOT NULL,
    frame bigint NOT NULL,
    round bigint NOT NULL,
    end_pass bigint NOT NULL,
    outstanding bigint NOT NULL,
    core_ms bigint DEFAULT 0 NOT NULL,
    completed_ms bigint
);


--
-- Name: workers; Type: TABLE; Schema: public; Owner: -
--

CREATE TABLE public.workers (
    id text NOT NULL,
    name text NOT NULL,
    cores bigint NOT NULL,
    build text NOT NULL,
    probe_digest text,
    registered_ms bigint NOT NULL,
    seen_ms bigint NOT NULL,
    accepted_nodes bigint DEFAULT 0 NOT NULL,
    refused_partials bigint DEFAULT 0 NOT NULL,
    failures_in_a_row bigint DEFAULT 0 NOT NULL,
    failed_ms bigint DEFAULT 0 NOT NULL,
    samples bigint DEFAULT 0 NOT NULL,
    core_ms bigint DEFAULT 0 NOT NULL,
    quarantine text
);


--
-- Data for Name: _sqlx_migrations; Type: TABLE DATA; Schema: public; Owner: -
--

COPY public._sqlx_migrations (version, description, installed_on, success, checksum, execution_time) FROM stdin;
1	first	2026-11-27 22:57:12.203049	t		0
2	counters	2026-11-27 22:57:12.203049	t		0
3	farm	2026-11-27 22:57:12.203049	t		0
4	targets	2026-11-27 22:57:12.203049	t		0
5	coordinators	2026-11-27 22:57:12.203049	t		0
6	places	2026-11-27 22:57:12.203049	t		0
7	repeats	2026-11-27 22:57:12.203049	t		0
8	checks	2026-11-27 22:57:12.203049	t		0
9	adaptive	2026-11-27 22:57:12.203049	t		0
10	held	2026-11-27 22:57:12.203049	t		0
11	trust	2026-11-27 22:57:12.203049	t		0
12	pace	2026-11-27 22:57:12.203049	t		0
13	open_waves	2026-11-27 22:57:12.203049	t		0
14	flip	2026-11-27 22:57:12.203049	t		0
15	lookups	2026-11-27 22:57:12.203049	t		0
16	failures	2026-11-27 22:57:12.203049	t		0
17	gathering	2026-11-27 22:57:12.203049	t		0
18	second_holders	2026-11-27 22:57:12.203049	t		0
\.


--
-- Data for Name: assets; Type: TABLE DATA; Schema: public; Owner: -
--

COPY public.assets (hash, size, created_ms) FROM stdin;
12dfebc7f82dd49f1ef75b14296d42167556a7a347612b06d3ea99f56bb800ed	570	1795820233091
d15619521bb65ebfd6c61a35a8e3bed9ae1b286886df7271491535ad0be972ee	31122	1795820233104
7275a78f1464d87c7b53175f5fc4276bfc4c2562fcbdcde98bcbc3b386895e17	6331	1795820343236
\.


--
-- Data for Name: checks; Type: TABLE DATA; Schema: public; Owner: -
--

COPY public.checks (id, job, round, frame, tile, level, idx, lease, second_lease) FROM stdin;
\.


--
-- Data for Name: events; Type: TABLE DATA; Schema: public; Owner: -
--

COPY public.events (id, kind, job, frame, round, created_ms) FROM stdin;
1	job	019d17c4-49c1-7136-947c-6a5bae78b9d0	\N	\N	1795820233153
2	job	019d17c4-49c1-7136-947c-6a5bae78b9d0	\N	\N	1795820242065
3	round	019d17c4-49c1-7136-947c-6a5bae78b9d0	0	0	1795820242642
4	round	019d17c4-49c1-7136-947c-6a5bae78b9d0	0	1	1795820242704
5	round	019d17c4-49c1-7136-947c-6a5bae78b9d0	0	2	1795820242756
6	round	019d17c4-49c1-7136-947c-6a5bae78b9d0	0	3	1795820242796
7	job	019d17c4-49c1-7136-947c-6a5bae78b9d0	\N	\N	1795820305426
8	job	019d17c5-64fd-710f-acab-d07d3d2399f5	\N	\N	1795820305661
9	job	019d17c5-64fd-710f-acab-d07d3d2399f5	\N	\N	1795820314478
10	round	019d17c5-64fd-710f-acab-d07d3d2399f5	0	0	1795820320565
11	round	019d17c5-64fd-710f-acab-d07d3d2399f5	0	1	1795820320937
12	round	019d17c5-64fd-710f-acab-d07d3d2399f5	0	2	1795820321051
13	job	019d17c5-64fd-710f-acab-d07d3d2399f5	\N	\N	1795820321113
14	round	019d17c5-64fd-710f-acab-d07d3d2399f5	0	3	1795820321140
15	round	019d17c5-64fd-710f-acab-d07d3d2399f5	0	4	1795820321171
16	round	019d17c5-64fd-710f-acab-d07d3d2399f5	0	5	1795820321281
17	job	019d17c5-a209-70ce-8f72-75972451a5ac	\N	\N	1795820321289
18	job	019d17c5-a209-70ce-8f72-75972451a5ac	\N	\N	1795820321303
19	round	019d17c5-64fd-710f-acab-d07d3d2399f5	0	6	1795820321311
20	round	019d17c5-64fd-710f-acab-d07d3d2399f5	0	7	1795820321453
21	round	019d17c5-64fd-710f-acab-d07d3d2399f5	0	8	1795820321458
22	round	019d17c5-64fd-710f-acab-d07d3d2399f5	0	9	1795820321466
23	round	019d17c5-a209-70ce-8f72-75972451a5ac	0	0	1795820321520
24	round	019d17c5-a209-70ce-8f72-75972451a5ac	0	1	1795820321679
25	round	019d17c5-a209-70ce-8f72-75972451a5ac	0	2	1795820321854
26	round	019d17c5-a209-70ce-8f72-75972451a5ac	0	3	1795820321961
27	round	019d17c5-a209-70ce-8f72-75972451a5ac	0	4	1795820322134
28	round	019d17c5-a209-70ce-8f72-75972451a5ac	0	5	1795820322378
29	job	019d17c5-a209-70ce-8f72-75972451a5ac	\N	\N	1795820322378
30	job	019d17c5-a6d1-7710-ba46-f7d255ad87f8	\N	\N	1795820322513
31	job	019d17c5-a6d1-7710-ba46-f7d255ad87f8	\N	\N	1795820322516
32	round	019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	0	1795820322938
33	round	019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	1	1795820323040
34	round	019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	2	1795820323235
35	round	019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	3	1795820323296
36	round	019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	4	1795820323567
37	round	019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	5	1795820324180
38	job	019d17c5-ae46-75e9-8059-13ef54248271	\N	\N	1795820324422
39	job	019d17c5-ae46-75e9-8059-13ef54248271	\N	\N	1795820332312
40	round	019d17c5-ae46-75e9-8059-13ef54248271	0	0	1795820339646
41	round	019d17c5-ae46-75e9-8059-13ef54248271	0	1	1795820339791
42	round	019d17c5-ae46-75e9-8059-13ef54248271	0	2	1795820340009
43	round	019d17c5-ae46-75e9-8059-13ef54248271	0	3	1795820340221
44	round	019d17c5-ae46-75e9-8059-13ef54248271	0	4	1795820340390
45	round	019d17c5-ae46-75e9-8059-13ef54248271	0	5	1795820341827
46	round	019d17c5-ae46-75e9-8059-13ef54248271	0	6	1795820342012
47	round	019d17c5-ae46-75e9-8059-13ef54248271	0	7	1795820343122
48	job	019d17c5-f825-748a-a41d-ec0e6975db8f	\N	\N	1795820343333
49	job	019d17c5-f825-748a-a41d-ec0e6975db8f	\N	\N	1795820352447
50	round	019d17c5-f825-748a-a41d-ec0e6975db8f	0	0	1795820352679
51	round	019d17c5-f825-748a-a41d-ec0e6975db8f	0	1	1795820352849
52	round	019d17c5-f825-748a-a41d-ec0e6975db8f	0	2	1795820352908
53	round	019d17c5-f825-748a-a41d-ec0e6975db8f	0	3	1795820353026
54	round	019d17c5-f825-748a-a41d-ec0e6975db8f	0	4	1795820353116
55	job	019d17c6-1eb9-777a-bb16-ce8945cc98f4	\N	\N	1795820353209
\.


--
-- Data for Name: farm; Type: TABLE DATA; Schema: public; Owner: -
--

COPY public.farm (single, id, has_blobs) FROM stdin;
1	01a21f3a-20c3-706b-8836-6cca9189fdd4	1
\.


--
-- Data for Name: job_assets; Type: TABLE DATA; Schema: public; Owner: -
--

COPY public.job_assets (job, path, hash) FROM stdin;
019d17c4-49c1-7136-947c-6a5bae78b9d0	heights/bump-back.exr	12dfebc7f82dd49f1ef75b14296d42167556a7a347612b06d3ea99f56bb800ed
019d17c4-49c1-7136-947c-6a5bae78b9d0	heights/bump-front.exr	d15619521bb65ebfd6c61a35a8e3bed9ae1b286886df7271491535ad0be972ee
019d17c5-64fd-710f-acab-d07d3d2399f5	heights/bump-back.exr	12dfebc7f82dd49f1ef75b14296d42167556a7a347612b06d3ea99f56bb800ed
019d17c5-64fd-710f-acab-d07d3d2399f5	heights/bump-front.exr	d15619521bb65ebfd6c61a35a8e3bed9ae1b286886df7271491535ad0be972ee
019d17c5-a209-70ce-8f72-75972451a5ac	heights/bump-back.exr	12dfebc7f82dd49f1ef75b14296d42167556a7a347612b06d3ea99f56bb800ed
019d17c5-a209-70ce-8f72-75972451a5ac	heights/bump-front.exr	d15619521bb65ebfd6c61a35a8e3bed9ae1b286886df7271491535ad0be972ee
019d17c5-a6d1-7710-ba46-f7d255ad87f8	heights/bump-back.exr	12dfebc7f82dd49f1ef75b14296d42167556a7a347612b06d3ea99f56bb800ed
019d17c5-a6d1-7710-ba46-f7d255ad87f8	heights/bump-front.exr	d15619521bb65ebfd6c61a35a8e3bed9ae1b286886df7271491535ad0be972ee
019d17c5-ae46-75e9-8059-13ef54248271	heights/bump-back.exr	12dfebc7f82dd49f1ef75b14296d42167556a7a347612b06d3ea99f56bb800ed
019d17c5-ae46-75e9-8059-13ef54248271	heights/bump-front.exr	d15619521bb65ebfd6c61a35a8e3bed9ae1b286886df7271491535ad0be972ee
019d17c5-f825-748a-a41d-ec0e6975db8f	heights/bump-back.exr	12dfebc7f82dd49f1ef75b14296d42167556a7a347612b06d3ea99f56bb800ed
019d17c5-f825-748a-a41d-ec0e6975db8f	heights/bump-front.exr	d15619521bb65ebfd6c61a35a8e3bed9ae1b286886df7271491535ad0be972ee
019d17c6-1eb9-777a-bb16-ce8945cc98f4	heights/bump-back.exr	12dfebc7f82dd49f1ef75b14296d42167556a7a347612b06d3ea99f56bb800ed
019d17c6-1eb9-777a-bb16-ce8945cc98f4	heights/bump-front.exr	d15619521bb65ebfd6c61a35a8e3bed9ae1b286886df7271491535ad0be972ee
\.


--
-- Data for Name: jobs; Type: TABLE DATA; Schema: public; Owner: -
--

COPY public.jobs (id, name, state, failure, priority, scene, scene_hash, integrator, missing_light, frames, width, height, tile_size, samples_per_pass, samples_per_block, passes, reference, time_limit_ms, created_ms, started_ms, finished_ms, cursor_round, cursor_frame, cursor_tile, rounds, complete_passes, accepted_nodes, samples, core_ms, counters, target_mse, target_estimated_mse, stopped_by, redone_nodes, probe_digest, adaptive, shared_samples) FROM stdin;
019d17c4-49c1-7136-947c-6a5bae78b9d0	failed	failed	node (frame 0, tile 1, level 3, index 1) failed again and again, at last: out of memory	0	{"camera":{"orthographic":{"height":0.22,"look_at":[0.15,-0.1306,-1.5],"position":[0.15,-0.1306,-1.49],"up":[0.0,1.0,0.0]}},"film":{"height":20,"width":24},"integrator":{"path":{"max_depth":16}},"lights":[{"sphere":{"centre":[-5.3769,4.6185,49.495],"name":"globe","radiance":[24000.0,21500.0,17500.0],"radius":0.2327}}],"materials":{"black":{"diffuse":{"reflectance":{"colour":[0.0,0.0,0.0]}}},"receiver":{"diffuse":{"reflectance":{"colour":[0.8,0.8,0.8]}}}},"meshes":[{"material":"receiver","name":"receiver","rotate":[0.0,0.0,0.0],"scale":1.0,"source":{"inline":{"positions":[[0.04,-0.2406,-1.5],[0.26,-0.2406,-1.5],[0.26,-0.0206,-1.5],[0.04,-0.0206,-1.5]],"triangles":[[0,1,2],[0,2,3]]}},"translate":[0.0,0.0,0.0]},{"material":"black","name":"surround","rotate":[0.0,0.0,0.0],"scale":1.0,"source":{"inline":{"positions":[[-2.0,-2.0,0.002],[2.0,-2.0,0.002],[2.0,2.0,0.002],[-2.0,2.0,0.002],[-0.05,-0.06,0.002],[0.05,-0.06,0.002],[0.05,0.06,0.002],[-0.05,0.06,0.002]],"triangles":[[0,1,5],[0,5,4],[1,2,6],[1,6,5],[2,3,7],[2,7,6],[3,0,4],[3,4,7]]}},"translate":[0.0,0.0,0.0]}],"name":"failed","panes":[{"absorption":[0.0,0.0,0.0],"back":{"height_map":{"file":"heights/bump-back.exr","offset":0.0,"scale":1.0}},"centre":[0.0,0.0,0.0],"front":{"height_map":{"file":"heights/bump-front.exr","offset":0.0,"scale":1.0}},"height":0.12,"index_of_refraction":1.5,"name":"bump","thickness":0.004,"width":0.1,"x_axis":[1.0,0.0,0.0],"y_axis":[0.0,1.0,0.0]}],"path_filter":"D TT L","sampling":{"samples_per_block":16,"samples_per_pass":4},"seed":1,"version":1}	263116436ebdffff8bee82aea198a3851866c8bbc73ce83f15b26d1dd9771aaa	path	["paths that do not match the path filter D TT L","paths of more than 16 vertices between camera and light (max_depth)"]	1	24	20	16	4	16	250000	\N	\N	1795820233153	1795820242065	1795820305426	64	0	0	4	8	16	15360	15	{"height_evaluations":56,"solver_calls":0,"converged":0,"unique_solutions":0,"trials":0,"truncated":0,"rays":28197,"samples":15360}	\N	\N	\N	0	1a1ae608dbcbce6b76755c004e9490a2d87570c1cb16ca940f40376526d8ab1d	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	cancelled	cancelled	\N	0	{"camera":{"orthographic":{"height":0.22,"look_at":[0.15,-0.1306,-1.5],"position":[0.15,-0.1306,-1.49],"up":[0.0,1.0,0.0]}},"film":{"height":20,"width":24},"integrator":{"cone":{"max_depth":16}},"lights":[{"sphere":{"centre":[-5.3769,4.6185,49.495],"name":"globe","radiance":[24000.0,21500.0,17500.0],"radius":0.2327}}],"materials":{"black":{"diffuse":{"reflectance":{"colour":[0.0,0.0,0.0]}}},"receiver":{"diffuse":{"reflectance":{"colour":[0.8,0.8,0.8]}}}},"meshes":[{"material":"receiver","name":"receiver","rotate":[0.0,0.0,0.0],"scale":1.0,"source":{"inline":{"positions":[[0.04,-0.2406,-1.5],[0.26,-0.2406,-1.5],[0.26,-0.0206,-1.5],[0.04,-0.0206,-1.5]],"triangles":[[0,1,2],[0,2,3]]}},"translate":[0.0,0.0,0.0]},{"material":"black","name":"surround","rotate":[0.0,0.0,0.0],"scale":1.0,"source":{"inline":{"positions":[[-2.0,-2.0,0.002],[2.0,-2.0,0.002],[2.0,2.0,0.002],[-2.0,2.0,0.002],[-0.05,-0.06,0.002],[0.05,-0.06,0.002],[0.05,0.06,0.002],[-0.05,0.06,0.002]],"triangles":[[0,1,5],[0,5,4],[1,2,6],[1,6,5],[2,3,7],[2,7,6],[3,0,4],[3,4,7]]}},"translate":[0.0,0.0,0.0]}],"name":"cancelled","panes":[{"absorption":[0.0,0.0,0.0],"back":{"height_map":{"file":"heights/bump-back.exr","offset":0.0,"scale":1.0}},"centre":[0.0,0.0,0.0],"front":{"height_map":{"file":"heights/bump-front.exr","offset":0.0,"scale":1.0}},"height":0.12,"index_of_refraction":1.5,"name":"bump","thickness":0.004,"width":0.1,"x_axis":[1.0,0.0,0.0],"y_axis":[0.0,1.0,0.0]}],"path_filter":"D TT L","sampling":{"samples_per_block":16,"samples_per_pass":4},"seed":1,"version":1}	96f990e2c265710fff8de8715baa5f3808646286a2ace675c394cbe849990c22	cone	["paths that do not match the path filter D TT L","paths of more than 16 vertices between camera and light (max_depth)"]	1	24	20	16	4	16	250000	\N	\N	1795820305661	1795820314478	1795820321113	64	0	0	10	96	42	208896	5895	{"height_evaluations":2872234,"solver_calls":0,"converged":0,"unique_solutions":438798,"trials":0,"truncated":0,"rays":1699918,"samples":208896}	\N	\N	\N	0	1a1ae608dbcbce6b76755c004e9490a2d87570c1cb16ca940f40376526d8ab1d	0	\N
019d17c5-a209-70ce-8f72-75972451a5ac	done	done	\N	0	{"camera":{"orthographic":{"height":0.22,"look_at":[0.15,-0.1306,-1.5],"position":[0.15,-0.1306,-1.49],"up":[0.0,1.0,0.0]}},"film":{"height":20,"width":24},"integrator":{"cone":{"max_depth":16}},"lights":[{"sphere":{"centre":[-5.3769,4.6185,49.495],"name":"globe","radiance":[24000.0,21500.0,17500.0],"radius":0.2327}}],"materials":{"black":{"diffuse":{"reflectance":{"colour":[0.0,0.0,0.0]}}},"receiver":{"diffuse":{"reflectance":{"colour":[0.8,0.8,0.8]}}}},"meshes":[{"material":"receiver","name":"receiver","rotate":[0.0,0.0,0.0],"scale":1.0,"source":{"inline":{"positions":[[0.04,-0.2406,-1.5],[0.26,-0.2406,-1.5],[0.26,-0.0206,-1.5],[0.04,-0.0206,-1.5]],"triangles":[[0,1,2],[0,2,3]]}},"translate":[0.0,0.0,0.0]},{"material":"black","name":"surround","rotate":[0.0,0.0,0.0],"scale":1.0,"source":{"inline":{"positions":[[-2.0,-2.0,0.002],[2.0,-2.0,0.002],[2.0,2.0,0.002],[-2.0,2.0,0.002],[-0.05,-0.06,0.002],[0.05,-0.06,0.002],[0.05,0.06,0.002],[-0.05,0.06,0.002]],"triangles":[[0,1,5],[0,5,4],[1,2,6],[1,6,5],[2,3,7],[2,7,6],[3,0,4],[3,4,7]]}},"translate":[0.0,0.0,0.0]}],"name":"done","panes":[{"absorption":[0.0,0.0,0.0],"back":{"height_map":{"file":"heights/bump-back.exr","offset":0.0,"scale":1.0}},"centre":[0.0,0.0,0.0],"front":{"height_map":{"file":"heights/bump-front.exr","offset":0.0,"scale":1.0}},"height":0.12,"index_of_refraction":1.5,"name":"bump","thickness":0.004,"width":0.1,"x_axis":[1.0,0.0,0.0],"y_axis":[0.0,1.0,0.0]}],"path_filter":"D TT L","sampling":{"samples_per_block":16,"samples_per_pass":4},"seed":1,"version":1}	d2f432d80581778a03a102c40fa9e2acf68903020ef4cc804d5ff95ea85b4b26	cone	["paths that do not match the path filter D TT L","paths of more than 16 vertices between camera and light (max_depth)"]	1	24	20	16	4	16	25	\N	\N	1795820321289	1795820321303	1795820322378	6	0	0	6	25	28	48000	386	{"height_evaluations":649582,"solver_calls":0,"converged":0,"unique_solutions":99419,"trials":0,"truncated":0,"rays":386391,"samples":48000}	\N	\N	samples	0	1a1ae608dbcbce6b76755c004e9490a2d87570c1cb16ca940f40376526d8ab1d	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	adaptive	running	\N	1	{"camera":{"orthographic":{"height":0.22,"look_at":[0.15,-0.1306,-1.5],"position":[0.15,-0.1306,-1.49],"up":[0.0,1.0,0.0]}},"film":{"height":20,"width":24},"integrator":{"cone":{"max_depth":16}},"lights":[{"sphere":{"centre":[-5.3769,4.6185,49.495],"name":"globe","radiance":[24000.0,21500.0,17500.0],"radius":0.2327}}],"materials":{"black":{"diffuse":{"reflectance":{"colour":[0.0,0.0,0.0]}}},"receiver":{"diffuse":{"reflectance":{"colour":[0.8,0.8,0.8]}}}},"meshes":[{"material":"receiver","name":"receiver","rotate":[0.0,0.0,0.0],"scale":1.0,"source":{"inline":{"positions":[[0.04,-0.2406,-1.5],[0.26,-0.2406,-1.5],[0.26,-0.0206,-1.5],[0.04,-0.0206,-1.5]],"triangles":[[0,1,2],[0,2,3]]}},"translate":[0.0,0.0,0.0]},{"material":"black","name":"surround","rotate":[0.0,0.0,0.0],"scale":1.0,"source":{"inline":{"positions":[[-2.0,-2.0,0.002],[2.0,-2.0,0.002],[2.0,2.0,0.002],[-2.0,2.0,0.002],[-0.05,-0.06,0.002],[0.05,-0.06,0.002],[0.05,0.06,0.002],[-0.05,0.06,0.002]],"triangles":[[0,1,5],[0,5,4],[1,2,6],[1,6,5],[2,3,7],[2,7,6],[3,0,4],[3,4,7]]}},"translate":[0.0,0.0,0.0]}],"name":"adaptive","panes":[{"absorption":[0.0,0.0,0.0],"back":{"height_map":{"file":"heights/bump-back.exr","offset":0.0,"scale":1.0}},"centre":[0.0,0.0,0.0],"front":{"height_map":{"file":"heights/bump-front.exr","offset":0.0,"scale":1.0}},"height":0.12,"index_of_refraction":1.5,"name":"bump","thickness":0.004,"width":0.1,"x_axis":[1.0,0.0,0.0],"y_axis":[0.0,1.0,0.0]}],"path_filter":"D TT L","sampling":{"samples_per_block":16,"samples_per_pass":4},"seed":1,"version":1}	51fba4046c2ef82a68db4d450634bad54f9b05fff76c1acef6ce8f48bf7a2e7c	cone	["paths that do not match the path filter D TT L","paths of more than 16 vertices between camera and light (max_depth)"]	1	24	20	16	4	16	200	\N	\N	1795820324422	1795820332312	\N	17	0	0	8	64	78	149504	2955	{"height_evaluations":2117435,"solver_calls":0,"converged":0,"unique_solutions":322684,"trials":0,"truncated":0,"rays":1243521,"samples":149504}	\N	\N	\N	0	1a1ae608dbcbce6b76755c004e9490a2d87570c1cb16ca940f40376526d8ab1d	1	340992
019d17c5-a6d1-7710-ba46-f7d255ad87f8	running	running	\N	0	{"camera":{"orthographic":{"height":0.22,"look_at":[0.15,-0.1306,-1.5],"position":[0.15,-0.1306,-1.49],"up":[0.0,1.0,0.0]}},"film":{"height":20,"width":24},"integrator":{"fnee":{"max_depth":16,"max_trials":1000,"selection":"all","solver":"complete"}},"lights":[{"sphere":{"centre":[-5.3769,4.6185,49.495],"name":"globe","radiance":[24000.0,21500.0,17500.0],"radius":0.2327}}],"materials":{"black":{"diffuse":{"reflectance":{"colour":[0.0,0.0,0.0]}}},"receiver":{"diffuse":{"reflectance":{"colour":[0.8,0.8,0.8]}}}},"meshes":[{"material":"receiver","name":"receiver","rotate":[0.0,0.0,0.0],"scale":1.0,"source":{"inline":{"positions":[[0.04,-0.2406,-1.5],[0.26,-0.2406,-1.5],[0.26,-0.0206,-1.5],[0.04,-0.0206,-1.5]],"triangles":[[0,1,2],[0,2,3]]}},"translate":[0.0,0.0,0.0]},{"material":"black","name":"surround","rotate":[0.0,0.0,0.0],"scale":1.0,"source":{"inline":{"positions":[[-2.0,-2.0,0.002],[2.0,-2.0,0.002],[2.0,2.0,0.002],[-2.0,2.0,0.002],[-0.05,-0.06,0.002],[0.05,-0.06,0.002],[0.05,0.06,0.002],[-0.05,0.06,0.002]],"triangles":[[0,1,5],[0,5,4],[1,2,6],[1,6,5],[2,3,7],[2,7,6],[3,0,4],[3,4,7]]}},"translate":[0.0,0.0,0.0]}],"name":"running","panes":[{"absorption":[0.0,0.0,0.0],"back":{"height_map":{"file":"heights/bump-back.exr","offset":0.0,"scale":1.0}},"centre":[0.0,0.0,0.0],"front":{"height_map":{"file":"heights/bump-front.exr","offset":0.0,"scale":1.0}},"height":0.12,"index_of_refraction":1.5,"name":"bump","thickness":0.004,"width":0.1,"x_axis":[1.0,0.0,0.0],"y_axis":[0.0,1.0,0.0]}],"path_filter":"D TT L","sampling":{"samples_per_block":16,"samples_per_pass":4},"seed":1,"version":1}	3fa793ba6cc4b6b89b6974c47889706c0a52bb22350e7cccbb552fa47ae9af50	fnee	["paths that do not match the path filter D TT L","paths of more than 16 vertices between camera and light (max_depth)","paths through a pane that the enumeration misses and a random seed finds with a small probability p, by up to the part (1 - p)^1000 of their light (max_trials)"]	1	24	20	16	4	16	300	\N	\N	1795820322513	1795820322516	\N	23	0	0	6	32	52	276480	7503	{"height_evaluations":5652380,"solver_calls":69005,"converged":68736,"unique_solutions":635833,"trials":0,"truncated":0,"rays":2415093,"samples":276480}	\N	\N	\N	0	1a1ae608dbcbce6b76755c004e9490a2d87570c1cb16ca940f40376526d8ab1d	0	\N
019d17c6-1eb9-777a-bb16-ce8945cc98f4	queued	queued	\N	0	{"camera":{"orthographic":{"height":0.22,"look_at":[0.15,-0.1306,-1.5],"position":[0.15,-0.1306,-1.49],"up":[0.0,1.0,0.0]}},"film":{"height":20,"width":24},"integrator":{"mnee":{"chains":["TT"],"max_depth":16,"missed":"left_to_chance"}},"lights":[{"sphere":{"centre":[-5.3769,4.6185,49.495],"name":"globe","radiance":[24000.0,21500.0,17500.0],"radius":0.2327}}],"materials":{"black":{"diffuse":{"reflectance":{"colour":[0.0,0.0,0.0]}}},"receiver":{"diffuse":{"reflectance":{"colour":[0.8,0.8,0.8]}}}},"meshes":[{"material":"receiver","name":"receiver","rotate":[0.0,0.0,0.0],"scale":1.0,"source":{"inline":{"positions":[[0.04,-0.2406,-1.5],[0.26,-0.2406,-1.5],[0.26,-0.0206,-1.5],[0.04,-0.0206,-1.5]],"triangles":[[0,1,2],[0,2,3]]}},"translate":[0.0,0.0,0.0]},{"material":"black","name":"surround","rotate":[0.0,0.0,0.0],"scale":1.0,"source":{"inline":{"positions":[[-2.0,-2.0,0.002],[2.0,-2.0,0.002],[2.0,2.0,0.002],[-2.0,2.0,0.002],[-0.05,-0.06,0.002],[0.05,-0.06,0.002],[0.05,0.06,0.002],[-0.05,0.06,0.002]],"triangles":[[0,1,5],[0,5,4],[1,2,6],[1,6,5],[2,3,7],[2,7,6],[3,0,4],[3,4,7]]}},"translate":[0.0,0.0,0.0]}],"name":"queued","panes":[{"absorption":[0.0,0.0,0.0],"back":{"height_map":{"file":"heights/bump-back.exr","offset":0.0,"scale":1.0}},"centre":[0.0,0.0,0.0],"front":{"height_map":{"file":"heights/bump-front.exr","offset":0.0,"scale":1.0}},"height":0.12,"index_of_refraction":1.5,"name":"bump","thickness":0.004,"width":0.1,"x_axis":[1.0,0.0,0.0],"y_axis":[0.0,1.0,0.0]}],"path_filter":"D TT L","sampling":{"samples_per_block":16,"samples_per_pass":4},"seed":1,"version":1}	b0dbf9ef008b87718f51c47e9a35948dc8ae05a441efdf71f3fbd9af5b077903	mnee	["paths that do not match the path filter D TT L","paths of more than 16 vertices between camera and light (max_depth)"]	1	24	20	16	4	16	9	\N	\N	1795820353209	\N	\N	0	0	0	0	0	0	0	0	{"height_evaluations":0,"solver_calls":0,"converged":0,"unique_solutions":0,"trials":0,"truncated":0,"rays":0,"samples":0}	\N	\N	\N	0	\N	0	\N
019d17c5-f825-748a-a41d-ec0e6975db8f	with a reference	running	\N	2	{"camera":{"orthographic":{"height":0.22,"look_at":[0.15,-0.1306,-1.5],"position":[0.15,-0.1306,-1.49],"up":[0.0,1.0,0.0]}},"film":{"height":20,"width":24},"integrator":{"fnee":{"max_depth":16,"max_trials":1000,"selection":"random","solver":"complete"}},"lights":[{"sphere":{"centre":[-5.3769,4.6185,49.495],"name":"globe","radiance":[24000.0,21500.0,17500.0],"radius":0.2327}}],"materials":{"black":{"diffuse":{"reflectance":{"colour":[0.0,0.0,0.0]}}},"receiver":{"diffuse":{"reflectance":{"colour":[0.8,0.8,0.8]}}}},"meshes":[{"material":"receiver","name":"receiver","rotate":[0.0,0.0,0.0],"scale":1.0,"source":{"inline":{"positions":[[0.04,-0.2406,-1.5],[0.26,-0.2406,-1.5],[0.26,-0.0206,-1.5],[0.04,-0.0206,-1.5]],"triangles":[[0,1,2],[0,2,3]]}},"translate":[0.0,0.0,0.0]},{"material":"black","name":"surround","rotate":[0.0,0.0,0.0],"scale":1.0,"source":{"inline":{"positions":[[-2.0,-2.0,0.002],[2.0,-2.0,0.002],[2.0,2.0,0.002],[-2.0,2.0,0.002],[-0.05,-0.06,0.002],[0.05,-0.06,0.002],[0.05,0.06,0.002],[-0.05,0.06,0.002]],"triangles":[[0,1,5],[0,5,4],[1,2,6],[1,6,5],[2,3,7],[2,7,6],[3,0,4],[3,4,7]]}},"translate":[0.0,0.0,0.0]}],"name":"with a reference","panes":[{"absorption":[0.0,0.0,0.0],"back":{"height_map":{"file":"heights/bump-back.exr","offset":0.0,"scale":1.0}},"centre":[0.0,0.0,0.0],"front":{"height_map":{"file":"heights/bump-front.exr","offset":0.0,"scale":1.0}},"height":0.12,"index_of_refraction":1.5,"name":"bump","thickness":0.004,"width":0.1,"x_axis":[1.0,0.0,0.0],"y_axis":[0.0,1.0,0.0]}],"path_filter":"D TT L","sampling":{"samples_per_block":16,"samples_per_pass":4},"seed":1,"version":1}	b85e53e66eb4469d975999a06cf3a0a3c35e965ddafd2651ad28f999ea5560e6	fnee	["paths that do not match the path filter D TT L","paths of more than 16 vertices between camera and light (max_depth)","paths through a pane that the enumeration misses and a random seed finds with a small probability p, by up to the part (1 - p)^1000 of their light (max_trials)"]	1	24	20	16	4	16	50	7275a78f1464d87c7b53175f5fc4276bfc4c2562fcbdcde98bcbc3b386895e17	\N	1795820343333	1795820352447	\N	8	0	0	5	16	23	59392	420	{"height_evaluations":424105,"solver_calls":15287,"converged":15239,"unique_solutions":14220,"trials":0,"truncated":0,"rays":151862,"samples":59392}	2e-05	\N	\N	0	1a1ae608dbcbce6b76755c004e9490a2d87570c1cb16ca940f40376526d8ab1d	0	\N
\.


--
-- Data for Name: keepers; Type: TABLE DATA; Schema: public; Owner: -
--

COPY public.keepers (job, coordinator, until_ms) FROM stdin;
\.


--
-- Data for Name: leases; Type: TABLE DATA; Schema: public; Owner: -
--

COPY public.leases (id, token, job, worker, state, nodes, granted_ms, deadline_ms, patience_ms, due_ms, gather_ms) FROM stdin;
019d17c6-9866-7576-a4aa-1dfd67310e1f	135	019d17c5-f825-748a-a41d-ec0e6975db8f	019d17c6-9849-736b-98d5-939999e65bd8	active	[[0,3,4,1]]	1795820384351	1795820444351	120000	1795820504351	1000
019d17c4-6c91-710a-a65f-da2732c18922	1	019d17c4-49c1-7136-947c-6a5bae78b9d0	019d17c4-6c5a-777e-ad3e-77e7222bdc3d	complete	[[0,0,0,0],[0,1,0,0]]	1795820242065	1795820302065	30000	1795820272561	1000
019d17c4-6e79-7483-b797-0ea267b8d1a8	2	019d17c4-49c1-7136-947c-6a5bae78b9d0	019d17c4-6c5a-777e-ad3e-77e7222bdc3d	complete	[[0,2,0,0],[0,3,0,0]]	1795820242551	1795820302551	30000	1795820272582	1000
019d17c4-6e93-7150-aa85-340f81ea6c08	3	019d17c4-49c1-7136-947c-6a5bae78b9d0	019d17c4-6c5a-777e-ad3e-77e7222bdc3d	complete	[[0,0,0,1],[0,1,0,1]]	1795820242577	1795820302577	30000	1795820272609	1000
019d17c4-6eb5-7032-9503-e2f63d54b7b7	4	019d17c4-49c1-7136-947c-6a5bae78b9d0	019d17c4-6c5a-777e-ad3e-77e7222bdc3d	complete	[[0,2,0,1],[0,3,0,1]]	1795820242610	1795820302610	30000	1795820272642	1000
019d17c4-6ed4-7141-ae3d-2f4ea4b19817	5	019d17c4-49c1-7136-947c-6a5bae78b9d0	019d17c4-6c5a-777e-ad3e-77e7222bdc3d	complete	[[0,0,1,1],[0,1,1,1]]	1795820242642	1795820302642	30000	1795820272664	1000
019d17c4-6eea-7525-93dd-a78a65145ba2	6	019d17c4-49c1-7136-947c-6a5bae78b9d0	019d17c4-6c5a-777e-ad3e-77e7222bdc3d	complete	[[0,2,1,1],[0,3,1,1]]	1795820242664	1795820302664	30000	1795820272701	1000
019d17c4-6f13-7565-9270-2dbfe0c1ebc6	7	019d17c4-49c1-7136-947c-6a5bae78b9d0	019d17c4-6c5a-777e-ad3e-77e7222bdc3d	complete	[[0,0,2,1],[0,1,2,1]]	1795820242705	1795820302705	30000	1795820272732	1000
019d17c4-6f2f-768f-a484-ac87a38a846b	8	019d17c4-49c1-7136-947c-6a5bae78b9d0	019d17c4-6c5a-777e-ad3e-77e7222bdc3d	complete	[[0,2,2,1],[0,3,2,1]]	1795820242732	1795820302732	30000	1795820272750	1000
019d17c4-8ae1-70ba-8fc4-c76fa1d8e31c	10	019d17c4-49c1-7136-947c-6a5bae78b9d0	019d17c4-8ab6-758a-97c3-b4842f6b8afb	returned	[[0,2,3,1],[0,3,3,1]]	1795820249818	1795820309818	30000	1795820279818	1000
019d17c4-a302-7656-aa30-3655a6ea482b	11	019d17c4-49c1-7136-947c-6a5bae78b9d0	019d17c4-a2fd-7534-a94c-1edc2dd563cb	returned	[[0,2,3,1],[0,3,3,1]]	1795820256001	1795820316001	30000	1795820286001	1000
019d17c4-bd55-72f4-ba71-9fed0ebdff69	12	019d17c4-49c1-7136-947c-6a5bae78b9d0	019d17c4-bd34-726a-aed0-882ac4b75d13	returned	[[0,2,3,1],[0,3,3,1]]	1795820262741	1795820322741	30000	1795820292741	1000
019d17c4-d5bc-772b-bb3c-4eb38fc8cbe7	13	019d17c4-49c1-7136-947c-6a5bae78b9d0	019d17c4-d5ad-773f-bd03-c643318f466e	returned	[[0,2,3,1],[0,3,3,1]]	1795820268988	1795820328988	30000	1795820298988	1000
019d17c4-eb52-7425-91f1-8aa6fe79e767	14	019d17c4-49c1-7136-947c-6a5bae78b9d0	019d17c4-eb45-76ab-b9a2-bf43e16da1b3	returned	[[0,1,3,1]]	1795820274507	1795820334507	120000	1795820394507	1000
019d17c4-6f41-70d8-9d32-9ea2bc6af497	9	019d17c4-49c1-7136-947c-6a5bae78b9d0	019d17c4-6c5a-777e-ad3e-77e7222bdc3d	complete	[[0,0,3,1],[0,1,3,1]]	1795820242750	1795820302750	30000	1795820272750	1000
019d17c5-01b9-7068-a848-c969dfedaf9f	15	019d17c4-49c1-7136-947c-6a5bae78b9d0	019d17c5-01a8-75ec-bef8-fcee3aa961e4	returned	[[0,0,3,1]]	1795820280249	1795820340249	120000	1795820400249	1000
019d17c5-15d4-7169-a72c-b91d1f0e52b6	16	019d17c4-49c1-7136-947c-6a5bae78b9d0	019d17c5-15ce-71c0-a92b-eda1a6190d51	returned	[[0,0,3,1],[0,1,3,1]]	1795820285397	1795820345397	30000	1795820315397	1000
019d17c5-2fda-7728-a53e-25369258d3c3	17	019d17c4-49c1-7136-947c-6a5bae78b9d0	019d17c5-2fd1-767a-af51-9cff9c850091	returned	[[0,0,3,1],[0,1,3,1]]	1795820292058	1795820352058	30000	1795820322058	1000
019d17c5-4943-7365-8bab-7433a65c5df1	18	019d17c4-49c1-7136-947c-6a5bae78b9d0	019d17c5-4939-75ce-91ef-25c57790eebf	returned	[[0,0,3,1],[0,1,3,1]]	1795820298563	1795820358563	30000	1795820328563	1000
019d17c5-641a-77ba-a2d3-1d2ee635ef3f	19	019d17c4-49c1-7136-947c-6a5bae78b9d0	019d17c5-63f8-7423-89f0-bf626cd3fcbc	returned	[[0,0,3,1],[0,1,3,1]]	1795820305420	1795820365420	30000	1795820335420	1000
019d17c5-8776-731f-bbf1-63a2ba624698	20	019d17c5-64fd-710f-acab-d07d3d2399f5	019d17c5-8768-7468-9394-44840874afce	complete	[[0,0,0,0],[0,1,0,0]]	1795820314478	1795820374478	30000	1795820344747	1000
019d17c5-8861-7019-af78-285e53632496	21	019d17c5-64fd-710f-acab-d07d3d2399f5	019d17c5-8768-7468-9394-44840874afce	complete	[[0,2,0,0],[0,3,0,0]]	1795820314721	1795820374721	30000	1795820344821	1000
019d17c5-886a-7444-a545-78aa2d150320	22	019d17c5-64fd-710f-acab-d07d3d2399f5	019d17c5-8768-7468-9394-44840874afce	complete	[[0,0,0,1],[0,1,0,1]]	1795820314730	1795820374730	30000	1795820344839	1000
019d17c5-8894-74b7-bb2a-6db1b76d8433	23	019d17c5-64fd-710f-acab-d07d3d2399f5	019d17c5-8768-7468-9394-44840874afce	complete	[[0,2,0,1],[0,3,0,1]]	1795820314772	1795820374772	30000	1795820344890	1000
019d17c5-889a-75dc-af20-258258e77952	24	019d17c5-64fd-710f-acab-d07d3d2399f5	019d17c5-8768-7468-9394-44840874afce	complete	[[0,0,1,1],[0,1,1,1]]	1795820314778	1795820374778	30000	1795820344990	1000
019d17c5-88d3-7000-ba0c-522fd8777b79	25	019d17c5-64fd-710f-acab-d07d3d2399f5	019d17c5-8768-7468-9394-44840874afce	complete	[[0,2,1,1],[0,3,1,1]]	1795820314836	1795820374836	30000	1795820345024	1000
019d17c5-8906-74ae-ab6f-0ba3d8f02bad	26	019d17c5-64fd-710f-acab-d07d3d2399f5	019d17c5-8768-7468-9394-44840874afce	complete	[[0,0,2,1],[0,1,2,1]]	1795820314886	1795820374886	30000	1795820345069	1000
019d17c5-898f-71ae-a41f-867028dad8b7	27	019d17c5-64fd-710f-acab-d07d3d2399f5	019d17c5-8768-7468-9394-44840874afce	complete	[[0,2,2,1],[0,3,2,1]]	1795820315023	1795820375023	30000	1795820345129	1000
019d17c5-89bd-778a-b759-1d5672a670cc	28	019d17c5-64fd-710f-acab-d07d3d2399f5	019d17c5-8768-7468-9394-44840874afce	complete	[[0,0,3,1],[0,1,3,1]]	1795820315070	1795820375070	30000	1795820345520	1000
019d17c5-8b84-74f1-85db-efaea04f9a59	29	019d17c5-64fd-710f-acab-d07d3d2399f5	019d17c5-8768-7468-9394-44840874afce	complete	[[0,2,3,1],[0,3,3,1]]	1795820315520	1795820375520	30000	1795820345623	1000
019d17c5-8bb1-7638-b5fe-9d800766fe29	30	019d17c5-64fd-710f-acab-d07d3d2399f5	019d17c5-8768-7468-9394-44840874afce	complete	[[0,0,4,1],[0,1,4,1]]	1795820315565	1795820375565	30000	1795820346527	1000
019d17c5-8f63-719c-a0d2-e294d4d5bc5d	31	019d17c5-64fd-710f-acab-d07d3d2399f5	019d17c5-8768-7468-9394-44840874afce	complete	[[0,2,4,1],[0,3,4,1]]	1795820316515	1795820376515	30000	1795820346609	1000
019d17c5-8fac-7371-8489-842104db81b8	32	019d17c5-64fd-710f-acab-d07d3d2399f5	019d17c5-8768-7468-9394-44840874afce	complete	[[0,0,4,2],[0,1,4,2]]	1795820316589	1795820376589	30000	1795820347597	1000
019d17c5-9397-7667-9e7a-61376c3c72bd	33	019d17c5-64fd-710f-acab-d07d3d2399f5	019d17c5-8768-7468-9394-44840874afce	complete	[[0,2,4,2],[0,3,4,2]]	1795820317591	1795820377591	30000	1795820347652	1000
019d17c5-974e-752c-8bc7-ce01e1991f53	35	019d17c5-64fd-710f-acab-d07d3d2399f5	019d17c5-8768-7468-9394-44840874afce	complete	[[0,2,4,3],[0,3,4,3]]	1795820318543	1795820378543	30000	1795820348670	1000
019d17c5-93d6-7763-8dd4-97d8680bcb75	34	019d17c5-64fd-710f-acab-d07d3d2399f5	019d17c5-8768-7468-9394-44840874afce	complete	[[0,0,4,3],[0,1,4,3]]	1795820317654	1795820377654	30000	1795820348547	1000
019d17c5-ac7a-7542-b141-39460793e968	68	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-8768-7468-9394-44840874afce	expired	[[0,0,4,2],[0,1,4,2]]	1795820323962	1795820383962	30000	1795820353962	1000
019d17c5-97ca-761c-9505-5160c88ff9af	36	019d17c5-64fd-710f-acab-d07d3d2399f5	019d17c5-8768-7468-9394-44840874afce	complete	[[0,0,4,4],[0,1,4,4]]	1795820318666	1795820378666	30000	1795820349367	1000
019d17c5-9a85-7071-ba40-fcb1a719ec22	37	019d17c5-64fd-710f-acab-d07d3d2399f5	019d17c5-8768-7468-9394-44840874afce	complete	[[0,2,4,4],[0,3,4,4]]	1795820319366	1795820379366	30000	1795820349470	1000
019d17c5-9aca-75e4-8b5a-5a3dec5075cd	38	019d17c5-64fd-710f-acab-d07d3d2399f5	019d17c5-8768-7468-9394-44840874afce	complete	[[0,0,4,5],[0,1,4,5]]	1795820319434	1795820379434	30000	1795820350224	1000
019d17c5-9ddb-7671-8bad-5caf4821a7b0	39	019d17c5-64fd-710f-acab-d07d3d2399f5	019d17c5-8768-7468-9394-44840874afce	complete	[[0,2,4,5],[0,3,4,5]]	1795820320220	1795820380220	30000	1795820350369	1000
019d17c5-9e59-72bf-8342-5df48faceef3	40	019d17c5-64fd-710f-acab-d07d3d2399f5	019d17c5-8768-7468-9394-44840874afce	complete	[[0,0,4,6],[0,1,4,6]]	1795820320345	1795820380345	30000	1795820351063	1000
019d17c5-a128-75bf-a46a-4202ec1e9b97	41	019d17c5-64fd-710f-acab-d07d3d2399f5	019d17c5-8768-7468-9394-44840874afce	ended	[[0,2,4,6],[0,3,4,6]]	1795820321064	1795820381064	30000	1795820351064	1000
019d17c5-a217-75d0-9ab8-adb8935f7046	42	019d17c5-a209-70ce-8f72-75972451a5ac	019d17c5-8768-7468-9394-44840874afce	complete	[[0,0,0,0],[0,1,0,0]]	1795820321303	1795820381303	30000	1795820351491	1000
019d17c5-a2d0-759f-9e6f-04766f5a6de1	43	019d17c5-a209-70ce-8f72-75972451a5ac	019d17c5-8768-7468-9394-44840874afce	complete	[[0,2,0,0],[0,3,0,0]]	1795820321488	1795820381488	30000	1795820351514	1000
019d17c5-a2e4-72a6-b11f-dcd4b5b116e9	44	019d17c5-a209-70ce-8f72-75972451a5ac	019d17c5-8768-7468-9394-44840874afce	complete	[[0,0,0,1],[0,1,0,1]]	1795820321509	1795820381509	30000	1795820351581	1000
019d17c5-a31e-7128-982e-bcbe3dca839d	45	019d17c5-a209-70ce-8f72-75972451a5ac	019d17c5-8768-7468-9394-44840874afce	complete	[[0,2,0,1],[0,3,0,1]]	1795820321566	1795820381566	30000	1795820351633	1000
019d17c5-a323-74c2-9771-fa68fa46c984	46	019d17c5-a209-70ce-8f72-75972451a5ac	019d17c5-8768-7468-9394-44840874afce	complete	[[0,0,1,1],[0,1,1,1]]	1795820321572	1795820381572	30000	1795820351700	1000
019d17c5-a344-72b7-a809-5db2e5b2680f	47	019d17c5-a209-70ce-8f72-75972451a5ac	019d17c5-8768-7468-9394-44840874afce	complete	[[0,2,1,1],[0,3,1,1]]	1795820321605	1795820381605	30000	1795820351817	1000
019d17c5-a34b-7335-90c0-1b148c4dfb44	48	019d17c5-a209-70ce-8f72-75972451a5ac	019d17c5-8768-7468-9394-44840874afce	complete	[[0,0,2,1],[0,1,2,1]]	1795820321611	1795820381611	30000	1795820351857	1000
019d17c5-a38b-7700-99ca-4d26c20e8e31	49	019d17c5-a209-70ce-8f72-75972451a5ac	019d17c5-8768-7468-9394-44840874afce	complete	[[0,2,2,1],[0,3,2,1]]	1795820321676	1795820381676	30000	1795820351955	1000
019d17c5-a3eb-7153-a768-db941ee32f89	50	019d17c5-a209-70ce-8f72-75972451a5ac	019d17c5-8768-7468-9394-44840874afce	complete	[[0,0,3,1],[0,1,3,1]]	1795820321771	1795820381771	30000	1795820351962	1000
019d17c5-a461-7613-b537-c04a50f538e9	51	019d17c5-a209-70ce-8f72-75972451a5ac	019d17c5-8768-7468-9394-44840874afce	complete	[[0,2,3,1],[0,3,3,1]]	1795820321889	1795820381889	30000	1795820352052	1000
019d17c5-a4a7-71d8-870c-12175e83562a	52	019d17c5-a209-70ce-8f72-75972451a5ac	019d17c5-8768-7468-9394-44840874afce	complete	[[0,0,3,2],[0,0,0,24]]	1795820321959	1795820381959	30000	1795820352174	1000
019d17c5-a51a-77d3-8880-36e5d8b5c222	53	019d17c5-a209-70ce-8f72-75972451a5ac	019d17c5-8768-7468-9394-44840874afce	complete	[[0,1,3,2],[0,1,0,24]]	1795820322075	1795820382075	30000	1795820352280	1000
019d17c5-a596-72fc-b670-3a3ca225187e	54	019d17c5-a209-70ce-8f72-75972451a5ac	019d17c5-8768-7468-9394-44840874afce	complete	[[0,2,3,2],[0,2,0,24]]	1795820322198	1795820382198	30000	1795820352302	1000
019d17c5-a5ff-7569-b563-7d6c512477b6	55	019d17c5-a209-70ce-8f72-75972451a5ac	019d17c5-8768-7468-9394-44840874afce	complete	[[0,3,3,2],[0,3,0,24]]	1795820322304	1795820382304	30000	1795820352370	1000
019d17c5-a6d4-702c-82a0-96e4df54d9aa	56	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-8768-7468-9394-44840874afce	complete	[[0,0,0,0],[0,1,0,0]]	1795820322516	1795820382516	30000	1795820352801	1000
019d17c5-a7dd-70a4-9b08-b3c2e75cd246	57	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-8768-7468-9394-44840874afce	complete	[[0,2,0,0],[0,3,0,0]]	1795820322782	1795820382782	30000	1795820352842	1000
019d17c5-a7ed-7418-a7b2-94b08625b7d4	58	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-8768-7468-9394-44840874afce	complete	[[0,0,0,1],[0,1,0,1]]	1795820322797	1795820382797	30000	1795820352909	1000
019d17c5-a817-7242-9223-d39c78975d56	59	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-8768-7468-9394-44840874afce	complete	[[0,2,0,1],[0,3,0,1]]	1795820322840	1795820382840	30000	1795820352989	1000
019d17c5-a829-710a-9115-48027bc45d4e	60	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-8768-7468-9394-44840874afce	complete	[[0,0,1,1],[0,1,1,1]]	1795820322858	1795820382858	30000	1795820353062	1000
019d17c5-a879-7565-b775-491ea709c7b0	61	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-8768-7468-9394-44840874afce	complete	[[0,2,1,1],[0,3,1,1]]	1795820322938	1795820382938	30000	1795820353112	1000
019d17c5-a8ab-755d-85e4-be3d96ceac7f	62	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-8768-7468-9394-44840874afce	complete	[[0,0,2,1],[0,1,2,1]]	1795820322987	1795820382987	30000	1795820353218	1000
019d17c5-a916-775d-a2ab-e02dd099e6e5	63	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-8768-7468-9394-44840874afce	complete	[[0,2,2,1],[0,3,2,1]]	1795820323095	1795820383095	30000	1795820353237	1000
019d17c5-a928-7760-94be-bc660eb0fbae	64	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-8768-7468-9394-44840874afce	complete	[[0,0,3,1],[0,1,3,1]]	1795820323112	1795820383112	30000	1795820353389	1000
019d17c5-aa3b-74b3-b324-9dc7ab974e58	65	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-8768-7468-9394-44840874afce	complete	[[0,2,3,1],[0,3,3,1]]	1795820323387	1795820383387	30000	1795820353436	1000
019d17c5-aa66-725c-8930-069fec4f1c85	66	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-8768-7468-9394-44840874afce	complete	[[0,0,4,1],[0,1,4,1]]	1795820323430	1795820383430	30000	1795820353897	1000
019d17c5-ac34-75a9-9e8c-ddabf3d751e2	67	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-8768-7468-9394-44840874afce	complete	[[0,2,4,1],[0,3,4,1]]	1795820323893	1795820383893	30000	1795820353966	1000
019d17c6-bce7-74f0-8fee-c63817ad20ea	137	019d17c5-f825-748a-a41d-ec0e6975db8f	019d17c6-bbde-747b-81dd-3d5ffcd0c325	active	[[0,0,4,2],[0,1,4,2]]	1795820393704	1795820453704	30000	1795820423704	1000
019d17c5-cd18-7492-b506-75ff5abf0c92	69	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,0,0,0],[0,1,0,0]]	1795820332312	1795820392312	30000	1795820362552	1000
019d17c5-ce09-7222-8c9b-e79c2b7dfd2b	70	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,2,0,0],[0,3,0,0]]	1795820332548	1795820392548	30000	1795820362607	1000
019d17c5-ce41-7683-b484-5f79328ac49c	71	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,0,0,1],[0,0,0,536870912]]	1795820332604	1795820392604	30000	1795820362644	1000
019d17c5-ce5c-74cf-b6eb-1c27f0658705	72	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,0,0,536870920],[0,0,0,536870928]]	1795820332631	1795820392631	30000	1795820362688	1000
019d17c5-ce89-7150-b86b-e3b537d07cbf	73	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,0,0,536870936],[0,0,0,536870944]]	1795820332677	1795820392677	30000	1795820362751	1000
019d17c5-ced1-75bf-a43d-6940fcad5976	74	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,0,0,536870952],[0,0,0,536870960]]	1795820332749	1795820392749	30000	1795820362804	1000
019d17c5-cf06-72b6-9d48-14ef467afbf1	75	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,0,0,536870968],[0,1,0,1]]	1795820332801	1795820392801	30000	1795820362833	1000
019d17c5-cf1e-75ef-b08b-5545955be65b	76	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,1,0,536870912],[0,1,0,536870920]]	1795820332825	1795820392825	30000	1795820362854	1000
019d17c5-cf26-7401-8313-bd94c644ba29	77	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,1,0,536870928],[0,1,0,536870936]]	1795820332833	1795820392833	30000	1795820362894	1000
019d17c5-cf3b-7348-b566-5e84cd138723	78	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,1,0,536870944],[0,1,0,536870952]]	1795820332854	1795820392854	30000	1795820362978	1000
019d17c5-cf52-7776-8b7d-92a34ca0ed6b	79	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,1,0,536870960],[0,1,0,536870968]]	1795820332878	1795820392878	30000	1795820363000	1000
019d17c5-cfa6-7043-be23-44257c714619	80	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,2,0,1],[0,2,0,536870912]]	1795820332961	1795820392961	30000	1795820363054	1000
019d17c5-cfc5-74a1-9ace-f6f0f2a0e7f6	81	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,2,0,536870920],[0,2,0,536870928]]	1795820332992	1795820392992	30000	1795820363078	1000
019d17c5-cffc-755d-bbfe-da1f0814883b	82	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,2,0,536870936],[0,2,0,536870944]]	1795820333048	1795820393048	30000	1795820363104	1000
019d17c5-d01b-70fa-b604-f97ee12b4a99	83	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,2,0,536870952],[0,2,0,536870960]]	1795820333078	1795820393078	30000	1795820363117	1000
019d17c5-d026-7575-9979-2aad14dcab9c	84	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,2,0,536870968],[0,3,0,1]]	1795820333089	1795820393089	30000	1795820363127	1000
019d17c5-d042-7652-b8da-11cf51ba638c	85	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,3,0,536870912],[0,3,0,536870920]]	1795820333117	1795820393117	30000	1795820363139	1000
019d17c5-d04b-72c4-af87-5ca8dcaf76a7	86	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,3,0,536870928],[0,3,0,536870936]]	1795820333126	1795820393126	30000	1795820363151	1000
019d17c5-d058-738e-8d8a-93e378f0120d	87	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,3,0,536870944],[0,3,0,536870952]]	1795820333139	1795820393139	30000	1795820363166	1000
019d17c5-d064-704f-8b17-c9364ba45816	88	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,3,0,536870960],[0,3,0,536870968]]	1795820333151	1795820393151	30000	1795820363215	1000
019d17c5-d075-77dc-861e-4741adcb3df4	89	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,0,1,1],[0,1,1,1]]	1795820333169	1795820393169	30000	1795820363226	1000
019d17c5-d0a4-71f9-9d2c-54b7e9e558e8	90	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,2,1,1],[0,3,1,1]]	1795820333215	1795820393215	30000	1795820363284	1000
019d17c5-d0af-771c-82dc-d60e49bfea6d	91	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,0,2,1],[0,1,2,1]]	1795820333226	1795820393226	30000	1795820363294	1000
019d17c5-d0f2-74b3-8bf6-ce64e80ceade	92	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,2,2,1],[0,3,2,1]]	1795820333294	1795820393294	30000	1795820363306	1000
019d17c5-d101-741a-ad1e-eaffb79cb77c	93	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,2,4,2],[0,3,4,2]]	1795820333308	1795820393308	30000	1795820363362	1000
019d17c5-d135-77ff-b30f-406ef5df7929	94	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,0,4,3],[0,1,4,3]]	1795820333360	1795820393360	30000	1795820364145	1000
019d17c5-d439-715a-858f-0a30e38912f8	95	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,2,4,3],[0,3,4,3]]	1795820334137	1795820394137	30000	1795820364245	1000
019d17c5-d482-75be-81dc-7e4d3bef2581	96	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,0,4,4],[0,1,4,4]]	1795820334210	1795820394210	30000	1795820364631	1000
019d17c5-d60b-76f0-bda0-fa2dc71181f6	97	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,2,4,4],[0,3,4,4]]	1795820334603	1795820394603	30000	1795820364663	1000
019d17c5-d642-709b-babe-8ee2aa343a3d	98	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,0,4,5],[0,1,4,5]]	1795820334659	1795820394659	30000	1795820365338	1000
019d17c5-d8e7-77ef-a651-c35d4e6f9f94	99	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,2,4,5],[0,3,4,5]]	1795820335336	1795820395336	30000	1795820365390	1000
019d17c5-d919-71df-8ba0-8688e17a5ed0	100	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,0,4,6],[0,1,4,6]]	1795820335386	1795820395386	30000	1795820366427	1000
019d17c5-dd5a-7660-bbea-de99cd6ebf97	102	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,0,4,7],[0,1,4,7]]	1795820336468	1795820396468	30000	1795820367588	1000
019d17c5-dd2e-70ae-8b3e-32ba2089c119	101	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,2,4,6],[0,3,4,6]]	1795820336424	1795820396424	30000	1795820366471	1000
019d17c6-1e5f-74b8-85ce-f132fbbbda5f	134	019d17c5-f825-748a-a41d-ec0e6975db8f	019d17c6-1ba9-71ea-9a13-5be99bf58148	complete	[[0,2,4,1],[0,3,4,1]]	1795820353119	1795820413119	30000	1795820383119	1000
019d17c6-bbf6-707f-a0da-8d8ea5dc7ab6	136	019d17c5-f825-748a-a41d-ec0e6975db8f	019d17c6-bbde-747b-81dd-3d5ffcd0c325	complete	[[0,2,4,1]]	1795820393463	1795820453463	120000	1795820513715	1000
019d17c5-e1b1-755e-890e-1cdfa41ead5b	103	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,2,4,7],[0,3,4,7]]	1795820337585	1795820397585	30000	1795820367646	1000
019d17c5-e1e9-74b9-94cf-3f025f0217a2	104	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,0,4,8],[0,1,4,8]]	1795820337641	1795820397641	30000	1795820368937	1000
019d17c5-e6fd-70a6-9c96-a0123aab05d7	105	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,2,4,8],[0,3,4,8]]	1795820338941	1795820398941	30000	1795820369102	1000
019d17c5-e79d-70a4-9116-0d5911a66973	106	019d17c5-a6d1-7710-ba46-f7d255ad87f8	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,0,4,9],[0,1,4,9]]	1795820339101	1795820399101	30000	1795820370127	1000
019d17c5-ebab-7582-b10a-5e51951b67c2	107	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,0,3,1],[0,1,2,2]]	1795820340139	1795820400139	30000	1795820370352	1000
019d17c5-ec6e-7192-b112-973822f8d6e9	108	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,2,2,2],[0,3,2,2]]	1795820340334	1795820400334	30000	1795820370371	1000
019d17c5-ec8d-731a-92cd-8fbf87bf587f	109	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,0,4,1],[0,1,3,2]]	1795820340365	1795820400365	30000	1795820371077	1000
019d17c5-ef4f-73f6-9c91-88f8a8f43b96	110	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,1,2,3],[0,2,3,2]]	1795820341071	1795820401071	30000	1795820371122	1000
019d17c5-ef7d-77f8-b90c-6ecf2ba7c67b	111	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,2,2,3],[0,3,3,2]]	1795820341117	1795820401117	30000	1795820371180	1000
019d17c5-efaf-77ae-bfc7-eb7141f6565a	112	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,3,2,3],[0,0,4,2]]	1795820341167	1795820401167	30000	1795820371720	1000
019d17c5-f1c3-708b-b2d0-be8102242334	113	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,1,3,3],[0,1,2,8]]	1795820341700	1795820401700	30000	1795820371829	1000
019d17c5-f242-703b-9ae4-93fc9db581be	114	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,2,3,3],[0,2,2,8]]	1795820341827	1795820401827	30000	1795820371913	1000
019d17c5-f283-70fa-88f2-7fac246b2fd3	115	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,3,3,3],[0,3,2,8]]	1795820341893	1795820401893	30000	1795820371928	1000
019d17c5-f298-748d-9c00-da3e0d56d304	116	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,0,4,3],[0,1,3,5]]	1795820341913	1795820401913	30000	1795820372287	1000
019d17c5-f409-754c-b096-17f3ee057286	117	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,1,2,9],[0,2,3,5]]	1795820342282	1795820402282	30000	1795820372357	1000
019d17c5-f444-7017-adba-a4811039c91d	118	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,2,2,9],[0,3,3,5]]	1795820342342	1795820402342	30000	1795820372454	1000
019d17c5-f465-765a-815e-899e6dad5070	119	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,3,2,9],[0,0,4,4]]	1795820342374	1795820402374	30000	1795820373001	1000
019d17c5-f6bc-721a-9c9f-49527b31655c	120	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,1,3,6],[0,1,2,14]]	1795820342973	1795820402973	30000	1795820373081	1000
019d17c5-f772-721d-be5e-0cef5a02ab2b	122	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	active	[[0,3,3,6],[0,3,2,14]]	1795820343154	1795820403154	30000	1795820373154	1000
019d17c5-f728-736b-9598-68295d978496	121	019d17c5-ae46-75e9-8059-13ef54248271	019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	complete	[[0,2,3,6],[0,2,2,14]]	1795820343081	1795820403081	30000	1795820373156	1000
019d17c6-1bbe-77a7-9c30-cf5e980cba3d	123	019d17c5-f825-748a-a41d-ec0e6975db8f	019d17c6-1ba9-71ea-9a13-5be99bf58148	complete	[[0,0,0,0],[0,1,0,0]]	1795820352447	1795820412447	30000	1795820382597	1000
019d17c6-1c4a-70bf-8450-26729ac5b948	124	019d17c5-f825-748a-a41d-ec0e6975db8f	019d17c6-1ba9-71ea-9a13-5be99bf58148	complete	[[0,2,0,0],[0,3,0,0]]	1795820352586	1795820412586	30000	1795820382625	1000
019d17c6-1c53-742f-8bf0-d2fd45e27f5d	125	019d17c5-f825-748a-a41d-ec0e6975db8f	019d17c6-1ba9-71ea-9a13-5be99bf58148	complete	[[0,0,0,1],[0,1,0,1]]	1795820352595	1795820412595	30000	1795820382639	1000
019d17c6-1c70-753e-9a5d-bddc3201a39b	126	019d17c5-f825-748a-a41d-ec0e6975db8f	019d17c6-1ba9-71ea-9a13-5be99bf58148	complete	[[0,2,0,1],[0,3,0,1]]	1795820352625	1795820412625	30000	1795820382673	1000
019d17c6-1c7a-7795-a9a5-6185d0fc45e9	127	019d17c5-f825-748a-a41d-ec0e6975db8f	019d17c6-1ba9-71ea-9a13-5be99bf58148	complete	[[0,0,1,1],[0,1,1,1]]	1795820352634	1795820412634	30000	1795820382711	1000
019d17c6-1c95-7241-8c8b-47afd534455f	128	019d17c5-f825-748a-a41d-ec0e6975db8f	019d17c6-1ba9-71ea-9a13-5be99bf58148	complete	[[0,2,1,1],[0,3,1,1]]	1795820352661	1795820412661	30000	1795820382775	1000
019d17c6-1cc5-75ef-b297-b36123bb6332	129	019d17c5-f825-748a-a41d-ec0e6975db8f	019d17c6-1ba9-71ea-9a13-5be99bf58148	complete	[[0,0,2,1],[0,1,2,1]]	1795820352709	1795820412709	30000	1795820382789	1000
019d17c6-1d03-717f-97c2-b83b01a7de0d	130	019d17c5-f825-748a-a41d-ec0e6975db8f	019d17c6-1ba9-71ea-9a13-5be99bf58148	complete	[[0,2,2,1],[0,3,2,1]]	1795820352772	1795820412772	30000	1795820382874	1000
019d17c6-1d12-70dd-b9b3-35db19b77c4c	131	019d17c5-f825-748a-a41d-ec0e6975db8f	019d17c6-1ba9-71ea-9a13-5be99bf58148	complete	[[0,0,3,1],[0,1,3,1]]	1795820352786	1795820412786	30000	1795820382901	1000
019d17c6-1d78-773d-8c04-b2740ac24502	132	019d17c5-f825-748a-a41d-ec0e6975db8f	019d17c6-1ba9-71ea-9a13-5be99bf58148	complete	[[0,2,3,1],[0,3,3,1]]	1795820352888	1795820412888	30000	1795820382941	1000
019d17c6-1d87-768d-b6da-bfbd355d1ac3	133	019d17c5-f825-748a-a41d-ec0e6975db8f	019d17c6-1ba9-71ea-9a13-5be99bf58148	complete	[[0,0,4,1],[0,1,4,1]]	1795820352903	1795820412903	30000	1795820383121	1000
\.


--
-- Data for Name: nodes; Type: TABLE DATA; Schema: public; Owner: -
--

COPY public.nodes (job, frame, tile, level, idx, first_pass, end_pass, blob, blob_offset, blob_length, counters, builds) FROM stdin;
019d17c5-f825-748a-a41d-ec0e6975db8f	0	2	4	1	16	32	nodes/019d17c5-f825-748a-a41d-ec0e6975db8f/019d17c6-bcf0-758a-90df-b2f55425fa81	0	1620	{"height_evaluations":3083,"solver_calls":264,"converged":264,"unique_solutions":246,"trials":0,"truncated":0,"rays":8428,"samples":4096}	["0.1.0+1fef4d5d9f4b"]
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	0	3	0	0	8	nodes/019d17c4-49c1-7136-947c-6a5bae78b9d0/019d17c4-6f66-739f-9efc-0800ab050e49	0	13396	{"height_evaluations":36,"solver_calls":0,"converged":0,"unique_solutions":0,"trials":0,"truncated":0,"rays":15384,"samples":8192}	["0.1.0+1fef4d5d9f4b"]
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	1	3	0	0	8	nodes/019d17c4-49c1-7136-947c-6a5bae78b9d0/019d17c4-6f66-739f-9efc-0800ab050e49	13396	6740	{"height_evaluations":15,"solver_calls":0,"converged":0,"unique_solutions":0,"trials":0,"truncated":0,"rays":7178,"samples":4096}	["0.1.0+1fef4d5d9f4b"]
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	2	3	0	0	8	nodes/019d17c4-49c1-7136-947c-6a5bae78b9d0/019d17c4-6f66-739f-9efc-0800ab050e49	20136	3412	{"height_evaluations":5,"solver_calls":0,"converged":0,"unique_solutions":0,"trials":0,"truncated":0,"rays":3843,"samples":2048}	["0.1.0+1fef4d5d9f4b"]
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	3	3	0	0	8	nodes/019d17c4-49c1-7136-947c-6a5bae78b9d0/019d17c4-6f66-739f-9efc-0800ab050e49	23548	1748	{"height_evaluations":0,"solver_calls":0,"converged":0,"unique_solutions":0,"trials":0,"truncated":0,"rays":1792,"samples":1024}	["0.1.0+1fef4d5d9f4b"]
019d17c5-64fd-710f-acab-d07d3d2399f5	0	0	4	6	96	112	nodes/019d17c5-64fd-710f-acab-d07d3d2399f5/019d17c5-a123-73f6-8b19-3cfab3d89cd0	0	6228	{"height_evaluations":285287,"solver_calls":0,"converged":0,"unique_solutions":42961,"trials":0,"truncated":0,"rays":159651,"samples":16384}	["0.1.0+1fef4d5d9f4b"]
019d17c5-64fd-710f-acab-d07d3d2399f5	0	1	4	6	96	112	nodes/019d17c5-64fd-710f-acab-d07d3d2399f5/019d17c5-a123-73f6-8b19-3cfab3d89cd0	6228	3156	{"height_evaluations":91478,"solver_calls":0,"converged":0,"unique_solutions":14464,"trials":0,"truncated":0,"rays":57740,"samples":8192}	["0.1.0+1fef4d5d9f4b"]
019d17c5-64fd-710f-acab-d07d3d2399f5	0	0	6	0	0	64	nodes/019d17c5-64fd-710f-acab-d07d3d2399f5/019d17c5-a27d-7171-98a4-fe9766c8817a	0	13396	{"height_evaluations":1140994,"solver_calls":0,"converged":0,"unique_solutions":171577,"trials":0,"truncated":0,"rays":637802,"samples":65536}	["0.1.0+1fef4d5d9f4b"]
019d17c5-64fd-710f-acab-d07d3d2399f5	0	1	6	0	0	64	nodes/019d17c5-64fd-710f-acab-d07d3d2399f5/019d17c5-a27d-7171-98a4-fe9766c8817a	13396	6740	{"height_evaluations":364855,"solver_calls":0,"converged":0,"unique_solutions":57741,"trials":0,"truncated":0,"rays":230635,"samples":32768}	["0.1.0+1fef4d5d9f4b"]
019d17c5-64fd-710f-acab-d07d3d2399f5	0	2	6	0	0	64	nodes/019d17c5-64fd-710f-acab-d07d3d2399f5/019d17c5-a27d-7171-98a4-fe9766c8817a	20136	3412	{"height_evaluations":119510,"solver_calls":0,"converged":0,"unique_solutions":19220,"trials":0,"truncated":0,"rays":88419,"samples":16384}	["0.1.0+1fef4d5d9f4b"]
019d17c5-64fd-710f-acab-d07d3d2399f5	0	3	6	0	0	64	nodes/019d17c5-64fd-710f-acab-d07d3d2399f5/019d17c5-a27d-7171-98a4-fe9766c8817a	23548	1748	{"height_evaluations":38227,"solver_calls":0,"converged":0,"unique_solutions":5744,"trials":0,"truncated":0,"rays":31582,"samples":8192}	["0.1.0+1fef4d5d9f4b"]
019d17c5-64fd-710f-acab-d07d3d2399f5	0	0	5	2	64	96	nodes/019d17c5-64fd-710f-acab-d07d3d2399f5/019d17c5-a2b4-755b-b074-705eb49edaf2	0	6228	{"height_evaluations":570671,"solver_calls":0,"converged":0,"unique_solutions":85768,"trials":0,"truncated":0,"rays":318830,"samples":32768}	["0.1.0+1fef4d5d9f4b"]
019d17c5-64fd-710f-acab-d07d3d2399f5	0	1	5	2	64	96	nodes/019d17c5-64fd-710f-acab-d07d3d2399f5/019d17c5-a2b4-755b-b074-705eb49edaf2	6228	3156	{"height_evaluations":182587,"solver_calls":0,"converged":0,"unique_solutions":28890,"trials":0,"truncated":0,"rays":115400,"samples":16384}	["0.1.0+1fef4d5d9f4b"]
019d17c5-64fd-710f-acab-d07d3d2399f5	0	2	5	2	64	96	nodes/019d17c5-64fd-710f-acab-d07d3d2399f5/019d17c5-a2b4-755b-b074-705eb49edaf2	9384	1620	{"height_evaluations":59821,"solver_calls":0,"converged":0,"unique_solutions":9619,"trials":0,"truncated":0,"rays":44245,"samples":8192}	["0.1.0+1fef4d5d9f4b"]
019d17c5-64fd-710f-acab-d07d3d2399f5	0	3	5	2	64	96	nodes/019d17c5-64fd-710f-acab-d07d3d2399f5/019d17c5-a2b4-755b-b074-705eb49edaf2	11004	852	{"height_evaluations":18804,"solver_calls":0,"converged":0,"unique_solutions":2814,"trials":0,"truncated":0,"rays":15614,"samples":4096}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a209-70ce-8f72-75972451a5ac	0	0	4	0	0	16	nodes/019d17c5-a209-70ce-8f72-75972451a5ac/019d17c5-a568-71b7-aac3-712bd8425a84	0	13396	{"height_evaluations":285216,"solver_calls":0,"converged":0,"unique_solutions":42972,"trials":0,"truncated":0,"rays":159692,"samples":16384}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a209-70ce-8f72-75972451a5ac	0	1	4	0	0	16	nodes/019d17c5-a209-70ce-8f72-75972451a5ac/019d17c5-a568-71b7-aac3-712bd8425a84	13396	6740	{"height_evaluations":91175,"solver_calls":0,"converged":0,"unique_solutions":14376,"trials":0,"truncated":0,"rays":57480,"samples":8192}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a209-70ce-8f72-75972451a5ac	0	2	4	0	0	16	nodes/019d17c5-a209-70ce-8f72-75972451a5ac/019d17c5-a568-71b7-aac3-712bd8425a84	20136	3412	{"height_evaluations":29828,"solver_calls":0,"converged":0,"unique_solutions":4780,"trials":0,"truncated":0,"rays":22035,"samples":4096}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a209-70ce-8f72-75972451a5ac	0	3	4	0	0	16	nodes/019d17c5-a209-70ce-8f72-75972451a5ac/019d17c5-a568-71b7-aac3-712bd8425a84	23548	1748	{"height_evaluations":9491,"solver_calls":0,"converged":0,"unique_solutions":1436,"trials":0,"truncated":0,"rays":7898,"samples":2048}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a209-70ce-8f72-75972451a5ac	0	0	3	2	16	24	nodes/019d17c5-a209-70ce-8f72-75972451a5ac/019d17c5-a566-7649-a14f-1860095dea3c	0	6228	{"height_evaluations":142615,"solver_calls":0,"converged":0,"unique_solutions":21451,"trials":0,"truncated":0,"rays":79732,"samples":8192}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a209-70ce-8f72-75972451a5ac	0	0	0	24	24	25	nodes/019d17c5-a209-70ce-8f72-75972451a5ac/019d17c5-a566-7649-a14f-1860095dea3c	6228	3156	{"height_evaluations":17781,"solver_calls":0,"converged":0,"unique_solutions":2730,"trials":0,"truncated":0,"rays":10114,"samples":1024}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a209-70ce-8f72-75972451a5ac	0	1	3	2	16	24	nodes/019d17c5-a209-70ce-8f72-75972451a5ac/019d17c5-a5da-77c3-9c60-b560e58b083b	0	3156	{"height_evaluations":45561,"solver_calls":0,"converged":0,"unique_solutions":7262,"trials":0,"truncated":0,"rays":28966,"samples":4096}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a209-70ce-8f72-75972451a5ac	0	1	0	24	24	25	nodes/019d17c5-a209-70ce-8f72-75972451a5ac/019d17c5-a5da-77c3-9c60-b560e58b083b	3156	1620	{"height_evaluations":5870,"solver_calls":0,"converged":0,"unique_solutions":888,"trials":0,"truncated":0,"rays":3564,"samples":512}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a209-70ce-8f72-75972451a5ac	0	2	3	2	16	24	nodes/019d17c5-a209-70ce-8f72-75972451a5ac/019d17c5-a5fd-7244-bed8-7c474f773a18	0	1620	{"height_evaluations":14884,"solver_calls":0,"converged":0,"unique_solutions":2433,"trials":0,"truncated":0,"rays":11139,"samples":2048}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a209-70ce-8f72-75972451a5ac	0	2	0	24	24	25	nodes/019d17c5-a209-70ce-8f72-75972451a5ac/019d17c5-a5fd-7244-bed8-7c474f773a18	1620	852	{"height_evaluations":1796,"solver_calls":0,"converged":0,"unique_solutions":294,"trials":0,"truncated":0,"rays":1362,"samples":256}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a209-70ce-8f72-75972451a5ac	0	3	3	2	16	24	nodes/019d17c5-a209-70ce-8f72-75972451a5ac/019d17c5-a63d-7397-bc23-cb2f34f12f95	0	852	{"height_evaluations":4779,"solver_calls":0,"converged":0,"unique_solutions":712,"trials":0,"truncated":0,"rays":3930,"samples":1024}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a209-70ce-8f72-75972451a5ac	0	3	0	24	24	25	nodes/019d17c5-a209-70ce-8f72-75972451a5ac/019d17c5-a63d-7397-bc23-cb2f34f12f95	852	468	{"height_evaluations":586,"solver_calls":0,"converged":0,"unique_solutions":85,"trials":0,"truncated":0,"rays":479,"samples":128}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	0	5	0	0	32	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-adb0-72c1-9331-7f90ebe9c7c9	0	13396	{"height_evaluations":944849,"solver_calls":11952,"converged":11898,"unique_solutions":96754,"trials":0,"truncated":0,"rays":351797,"samples":32768}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	1	5	0	0	32	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-adb0-72c1-9331-7f90ebe9c7c9	13396	6740	{"height_evaluations":224736,"solver_calls":2734,"converged":2734,"unique_solutions":31282,"trials":0,"truncated":0,"rays":122565,"samples":16384}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	2	5	0	0	32	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-adb0-72c1-9331-7f90ebe9c7c9	20136	3412	{"height_evaluations":65597,"solver_calls":502,"converged":502,"unique_solutions":10073,"trials":0,"truncated":0,"rays":45612,"samples":8192}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	3	5	0	0	32	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-adb0-72c1-9331-7f90ebe9c7c9	23548	1748	{"height_evaluations":20433,"solver_calls":119,"converged":119,"unique_solutions":2971,"trials":0,"truncated":0,"rays":16089,"samples":4096}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	2	4	2	32	48	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-d135-77ff-b30f-406fe9f5c311	0	1620	{"height_evaluations":33069,"solver_calls":264,"converged":264,"unique_solutions":5048,"trials":0,"truncated":0,"rays":22836,"samples":4096}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	3	4	2	32	48	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-d135-77ff-b30f-406fe9f5c311	1620	852	{"height_evaluations":10107,"solver_calls":59,"converged":59,"unique_solutions":1465,"trials":0,"truncated":0,"rays":7981,"samples":2048}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	0	4	3	48	64	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-d435-73f7-a9e5-00febf1a402c	0	6228	{"height_evaluations":471626,"solver_calls":5975,"converged":5949,"unique_solutions":48436,"trials":0,"truncated":0,"rays":176070,"samples":16384}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	1	4	3	48	64	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-d435-73f7-a9e5-00febf1a402c	6228	3156	{"height_evaluations":112709,"solver_calls":1383,"converged":1382,"unique_solutions":15755,"trials":0,"truncated":0,"rays":61623,"samples":8192}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	2	4	3	48	64	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-d487-703a-ab6e-99d38e77f4f8	0	1620	{"height_evaluations":32764,"solver_calls":253,"converged":253,"unique_solutions":5041,"trials":0,"truncated":0,"rays":22811,"samples":4096}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	3	4	3	48	64	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-d487-703a-ab6e-99d38e77f4f8	1620	852	{"height_evaluations":10381,"solver_calls":64,"converged":64,"unique_solutions":1488,"trials":0,"truncated":0,"rays":8050,"samples":2048}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	0	4	4	64	80	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-d611-7286-819d-e7a0939490b7	0	6228	{"height_evaluations":474955,"solver_calls":6040,"converged":5995,"unique_solutions":48451,"trials":0,"truncated":0,"rays":176113,"samples":16384}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	1	4	4	64	80	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-d611-7286-819d-e7a0939490b7	6228	3156	{"height_evaluations":112285,"solver_calls":1362,"converged":1361,"unique_solutions":15677,"trials":0,"truncated":0,"rays":61394,"samples":8192}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	2	4	4	64	80	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-d643-757e-a692-5a97a273aea9	0	1620	{"height_evaluations":32838,"solver_calls":244,"converged":244,"unique_solutions":5033,"trials":0,"truncated":0,"rays":22783,"samples":4096}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	3	4	4	64	80	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-d643-757e-a692-5a97a273aea9	1620	852	{"height_evaluations":10078,"solver_calls":64,"converged":64,"unique_solutions":1490,"trials":0,"truncated":0,"rays":8062,"samples":2048}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	0	4	5	80	96	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-d8e8-7387-a270-7f7190311c88	0	6228	{"height_evaluations":472874,"solver_calls":5987,"converged":5957,"unique_solutions":48417,"trials":0,"truncated":0,"rays":176010,"samples":16384}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	1	4	5	80	96	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-d8e8-7387-a270-7f7190311c88	6228	3156	{"height_evaluations":112717,"solver_calls":1369,"converged":1369,"unique_solutions":15661,"trials":0,"truncated":0,"rays":61341,"samples":8192}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	2	4	5	80	96	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-d91d-71ae-a3cd-2dfa7edefc9c	0	1620	{"height_evaluations":32676,"solver_calls":242,"converged":242,"unique_solutions":5071,"trials":0,"truncated":0,"rays":22903,"samples":4096}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	3	4	5	80	96	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-d91d-71ae-a3cd-2dfa7edefc9c	1620	852	{"height_evaluations":10121,"solver_calls":58,"converged":58,"unique_solutions":1479,"trials":0,"truncated":0,"rays":8023,"samples":2048}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	0	4	6	96	112	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-dd2f-743d-b25b-9d23a458f81d	0	6228	{"height_evaluations":473223,"solver_calls":5992,"converged":5960,"unique_solutions":48444,"trials":0,"truncated":0,"rays":176101,"samples":16384}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	1	4	6	96	112	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-dd2f-743d-b25b-9d23a458f81d	6228	3156	{"height_evaluations":112592,"solver_calls":1360,"converged":1360,"unique_solutions":15634,"trials":0,"truncated":0,"rays":61264,"samples":8192}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	2	4	6	96	112	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-dd5a-7660-bbea-de9a9eab1262	0	1620	{"height_evaluations":32884,"solver_calls":240,"converged":240,"unique_solutions":5030,"trials":0,"truncated":0,"rays":22784,"samples":4096}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	3	4	6	96	112	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-dd5a-7660-bbea-de9a9eab1262	1620	852	{"height_evaluations":10337,"solver_calls":62,"converged":62,"unique_solutions":1489,"trials":0,"truncated":0,"rays":8053,"samples":2048}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	0	4	7	112	128	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-e1ae-714b-8844-b5b45837b760	0	6228	{"height_evaluations":471296,"solver_calls":6002,"converged":5974,"unique_solutions":48515,"trials":0,"truncated":0,"rays":176292,"samples":16384}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	1	4	7	112	128	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-e1ae-714b-8844-b5b45837b760	6228	3156	{"height_evaluations":112352,"solver_calls":1374,"converged":1373,"unique_solutions":15682,"trials":0,"truncated":0,"rays":61401,"samples":8192}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	2	4	7	112	128	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-e1eb-75c6-b7f9-853f89d43606	0	1620	{"height_evaluations":32890,"solver_calls":245,"converged":245,"unique_solutions":4977,"trials":0,"truncated":0,"rays":22619,"samples":4096}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	3	4	7	112	128	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-e1eb-75c6-b7f9-853f89d43606	1620	852	{"height_evaluations":10474,"solver_calls":63,"converged":63,"unique_solutions":1476,"trials":0,"truncated":0,"rays":8020,"samples":2048}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	0	4	8	128	144	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-e6f7-7238-8a8b-68d17e79adc6	0	6228	{"height_evaluations":472061,"solver_calls":5960,"converged":5931,"unique_solutions":48523,"trials":0,"truncated":0,"rays":176331,"samples":16384}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	1	4	8	128	144	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-e6f7-7238-8a8b-68d17e79adc6	6228	3156	{"height_evaluations":112347,"solver_calls":1361,"converged":1359,"unique_solutions":15760,"trials":0,"truncated":0,"rays":61629,"samples":8192}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	2	4	8	128	144	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-e79d-70a4-9116-0d5a62e391e3	0	1620	{"height_evaluations":33070,"solver_calls":249,"converged":249,"unique_solutions":5067,"trials":0,"truncated":0,"rays":22889,"samples":4096}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	3	4	8	128	144	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-e79d-70a4-9116-0d5a62e391e3	1620	852	{"height_evaluations":10358,"solver_calls":64,"converged":64,"unique_solutions":1466,"trials":0,"truncated":0,"rays":7990,"samples":2048}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	0	4	9	144	160	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-eb9d-74f0-8f54-89db32060e04	0	6228	{"height_evaluations":471625,"solver_calls":6003,"converged":5984,"unique_solutions":48507,"trials":0,"truncated":0,"rays":176289,"samples":16384}	["0.1.0+1fef4d5d9f4b"]
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	1	4	9	144	160	nodes/019d17c5-a6d1-7710-ba46-f7d255ad87f8/019d17c5-eb9d-74f0-8f54-89db32060e04	6228	3156	{"height_evaluations":112056,"solver_calls":1359,"converged":1358,"unique_solutions":15671,"trials":0,"truncated":0,"rays":61368,"samples":8192}	["0.1.0+1fef4d5d9f4b"]
019d17c5-ae46-75e9-8059-13ef54248271	0	1	5	0	0	32	nodes/019d17c5-ae46-75e9-8059-13ef54248271/019d17c5-f279-775c-9c76-c01f192fc662	13396	6740	{"height_evaluations":182164,"solver_calls":0,"converged":0,"unique_solutions":28837,"trials":0,"truncated":0,"rays":115215,"samples":16384}	["0.1.0+1fef4d5d9f4b"]
019d17c5-ae46-75e9-8059-13ef54248271	0	2	5	0	0	32	nodes/019d17c5-ae46-75e9-8059-13ef54248271/019d17c5-f303-72f0-a7ab-aa196a4577de	0	3412	{"height_evaluations":59689,"solver_calls":0,"converged":0,"unique_solutions":9618,"trials":0,"truncated":0,"rays":44233,"samples":8192}	["0.1.0+1fef4d5d9f4b"]
019d17c5-ae46-75e9-8059-13ef54248271	0	3	5	0	0	32	nodes/019d17c5-ae46-75e9-8059-13ef54248271/019d17c5-f303-72f0-a7ab-aa196a4577de	3412	1748	{"height_evaluations":19087,"solver_calls":0,"converged":0,"unique_solutions":2862,"trials":0,"truncated":0,"rays":15764,"samples":4096}	["0.1.0+1fef4d5d9f4b"]
019d17c5-ae46-75e9-8059-13ef54248271	0	0	4	4	64	80	nodes/019d17c5-ae46-75e9-8059-13ef54248271/019d17c5-f6d2-705c-934a-117badf00d15	852	6228	{"height_evaluations":285373,"solver_calls":0,"converged":0,"unique_solutions":42909,"trials":0,"truncated":0,"rays":159489,"samples":16384}	["0.1.0+1fef4d5d9f4b"]
019d17c5-ae46-75e9-8059-13ef54248271	0	1	3	6	48	56	nodes/019d17c5-ae46-75e9-8059-13ef54248271/019d17c5-f727-76f2-bb73-b1990aa60576	0	3156	{"height_evaluations":45818,"solver_calls":0,"converged":0,"unique_solutions":7237,"trials":0,"truncated":0,"rays":28885,"samples":4096}	["0.1.0+1fef4d5d9f4b"]
019d17c5-ae46-75e9-8059-13ef54248271	0	1	2	14	56	60	nodes/019d17c5-ae46-75e9-8059-13ef54248271/019d17c5-f727-76f2-bb73-b1990aa60576	3156	3156	{"height_evaluations":22879,"solver_calls":0,"converged":0,"unique_solutions":3614,"trials":0,"truncated":0,"rays":14428,"samples":2048}	["0.1.0+1fef4d5d9f4b"]
019d17c5-ae46-75e9-8059-13ef54248271	0	2	3	6	48	56	nodes/019d17c5-ae46-75e9-8059-13ef54248271/019d17c5-f773-76e6-808e-d728fe6e8f8f	0	1620	{"height_evaluations":14858,"solver_calls":0,"converged":0,"unique_solutions":2392,"trials":0,"truncated":0,"rays":11022,"samples":2048}	["0.1.0+1fef4d5d9f4b"]
019d17c5-ae46-75e9-8059-13ef54248271	0	2	2	14	56	60	nodes/019d17c5-ae46-75e9-8059-13ef54248271/019d17c5-f773-76e6-808e-d728fe6e8f8f	1620	1620	{"height_evaluations":7414,"solver_calls":0,"converged":0,"unique_solutions":1195,"trials":0,"truncated":0,"rays":5507,"samples":1024}	["0.1.0+1fef4d5d9f4b"]
019d17c5-ae46-75e9-8059-13ef54248271	0	0	6	0	0	64	nodes/019d17c5-ae46-75e9-8059-13ef54248271/019d17c5-f7b5-7766-930d-26638c822cb9	0	13396	{"height_evaluations":1140994,"solver_calls":0,"converged":0,"unique_solutions":171577,"trials":0,"truncated":0,"rays":637802,"samples":65536}	["0.1.0+1fef4d5d9f4b"]
019d17c5-ae46-75e9-8059-13ef54248271	0	1	4	2	32	48	nodes/019d17c5-ae46-75e9-8059-13ef54248271/019d17c5-f7b5-7766-930d-26638c822cb9	13396	3156	{"height_evaluations":91242,"solver_calls":0,"converged":0,"unique_solutions":14427,"trials":0,"truncated":0,"rays":57641,"samples":8192}	["0.1.0+1fef4d5d9f4b"]
019d17c5-ae46-75e9-8059-13ef54248271	0	2	4	2	32	48	nodes/019d17c5-ae46-75e9-8059-13ef54248271/019d17c5-f7b5-7766-930d-26638c822cb9	16552	1620	{"height_evaluations":29989,"solver_calls":0,"converged":0,"unique_solutions":4786,"trials":0,"truncated":0,"rays":22050,"samples":4096}	["0.1.0+1fef4d5d9f4b"]
019d17c5-ae46-75e9-8059-13ef54248271	0	3	4	2	32	48	nodes/019d17c5-ae46-75e9-8059-13ef54248271/019d17c5-f7b5-7766-930d-26638c822cb9	18172	852	{"height_evaluations":9473,"solver_calls":0,"converged":0,"unique_solutions":1439,"trials":0,"truncated":0,"rays":7903,"samples":2048}	["0.1.0+1fef4d5d9f4b"]
019d17c5-f825-748a-a41d-ec0e6975db8f	0	2	4	0	0	16	nodes/019d17c5-f825-748a-a41d-ec0e6975db8f/019d17c6-1e08-76b0-afc4-daa5efd7e49b	20136	3412	{"height_evaluations":2849,"solver_calls":241,"converged":241,"unique_solutions":228,"trials":0,"truncated":0,"rays":8378,"samples":4096}	["0.1.0+1fef4d5d9f4b"]
019d17c5-f825-748a-a41d-ec0e6975db8f	0	3	4	0	0	16	nodes/019d17c5-f825-748a-a41d-ec0e6975db8f/019d17c6-1e08-76b0-afc4-daa5efd7e49b	23548	1748	{"height_evaluations":699,"solver_calls":61,"converged":61,"unique_solutions":60,"trials":0,"truncated":0,"rays":3766,"samples":2048}	["0.1.0+1fef4d5d9f4b"]
019d17c5-f825-748a-a41d-ec0e6975db8f	0	0	5	0	0	32	nodes/019d17c5-f825-748a-a41d-ec0e6975db8f/019d17c6-1e80-745e-94b3-bb0e00452c8a	0	13396	{"height_evaluations":374649,"solver_calls":11968,"converged":11920,"unique_solutions":11123,"trials":0,"truncated":0,"rays":94890,"samples":32768}	["0.1.0+1fef4d5d9f4b"]
019d17c5-f825-748a-a41d-ec0e6975db8f	0	1	5	0	0	32	nodes/019d17c5-f825-748a-a41d-ec0e6975db8f/019d17c6-1e80-745e-94b3-bb0e00452c8a	13396	6740	{"height_evaluations":42825,"solver_calls":2753,"converged":2753,"unique_solutions":2563,"trials":0,"truncated":0,"rays":36400,"samples":16384}	["0.1.0+1fef4d5d9f4b"]
\.


--
-- Data for Name: opinions; Type: TABLE DATA; Schema: public; Owner: -
--

COPY public.opinions (check_id, worker, digest) FROM stdin;
\.


--
-- Data for Name: pending; Type: TABLE DATA; Schema: public; Owner: -
--

COPY public.pending (job, round, frame, tile, level, idx, failures, lease, repeats, failed_by) FROM stdin;
019d17c5-a6d1-7710-ba46-f7d255ad87f8	6	0	0	4	2	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	6	0	1	4	2	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	13	0	2	4	9	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	13	0	3	4	9	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	14	0	0	4	10	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	14	0	1	4	10	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	14	0	2	4	10	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	14	0	3	4	10	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	15	0	0	4	11	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	15	0	1	4	11	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	15	0	2	4	11	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	15	0	3	4	11	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	16	0	0	4	12	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	16	0	1	4	12	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	16	0	2	4	12	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	16	0	3	4	12	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	17	0	0	4	13	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	17	0	1	4	13	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	17	0	2	4	13	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	17	0	3	4	13	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	18	0	0	4	14	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	18	0	1	4	14	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	18	0	2	4	14	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	18	0	3	4	14	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	19	0	0	4	15	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	19	0	1	4	15	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	19	0	2	4	15	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	19	0	3	4	15	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	20	0	0	4	16	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	20	0	1	4	16	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	20	0	2	4	16	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	20	0	3	4	16	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	21	0	0	4	17	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	21	0	1	4	17	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	21	0	2	4	17	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	21	0	3	4	17	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	22	0	0	3	36	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	22	0	0	2	74	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	22	0	1	3	36	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	22	0	1	2	74	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	22	0	2	3	36	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	22	0	2	2	74	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	22	0	3	3	36	0	\N	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	22	0	3	2	74	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	9	0	0	4	5	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	9	0	1	2	15	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	9	0	1	3	8	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	9	0	2	2	15	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	9	0	2	3	8	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	9	0	3	2	15	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	9	0	3	3	8	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	10	0	0	4	6	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	10	0	1	3	9	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	10	0	1	2	20	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	10	0	2	3	9	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	10	0	2	2	20	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	10	0	3	3	9	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	10	0	3	2	20	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	11	0	0	4	7	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	11	0	1	2	21	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	11	0	1	3	11	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	11	0	2	2	21	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	11	0	2	3	11	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	11	0	3	2	21	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	11	0	3	3	11	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	12	0	0	4	8	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	12	0	1	3	12	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	12	0	1	2	26	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	12	0	2	3	12	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	12	0	2	2	26	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	12	0	3	3	12	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	12	0	3	2	26	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	13	0	0	4	9	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	13	0	1	2	27	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	13	0	1	3	14	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	13	0	2	2	27	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	13	0	2	3	14	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	13	0	3	2	27	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	13	0	3	3	14	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	14	0	0	4	10	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	14	0	1	3	15	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	14	0	1	2	32	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	14	0	2	3	15	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	14	0	2	2	32	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	14	0	3	3	15	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	14	0	3	2	32	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	15	0	0	4	11	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	15	0	1	2	33	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	15	0	1	3	17	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	15	0	2	2	33	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	15	0	2	3	17	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	15	0	3	2	33	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	15	0	3	3	17	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	16	0	0	3	24	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	16	0	1	3	18	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	16	0	2	3	18	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	16	0	3	3	18	0	\N	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	8	0	3	3	6	0	019d17c5-f772-721d-be5e-0cef5a02ab2b	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	8	0	3	2	14	0	019d17c5-f772-721d-be5e-0cef5a02ab2b	0	\N
019d17c5-f825-748a-a41d-ec0e6975db8f	5	0	3	4	1	0	019d17c6-9866-7576-a4aa-1dfd67310e1f	1	\N
019d17c5-f825-748a-a41d-ec0e6975db8f	6	0	0	4	2	0	019d17c6-bce7-74f0-8fee-c63817ad20ea	0	\N
019d17c5-f825-748a-a41d-ec0e6975db8f	6	0	1	4	2	0	019d17c6-bce7-74f0-8fee-c63817ad20ea	0	\N
019d17c5-f825-748a-a41d-ec0e6975db8f	6	0	2	4	2	0	\N	0	\N
019d17c5-f825-748a-a41d-ec0e6975db8f	6	0	3	4	2	0	\N	0	\N
019d17c5-f825-748a-a41d-ec0e6975db8f	7	0	0	1	24	0	\N	0	\N
019d17c5-f825-748a-a41d-ec0e6975db8f	7	0	1	1	24	0	\N	0	\N
019d17c5-f825-748a-a41d-ec0e6975db8f	7	0	2	1	24	0	\N	0	\N
019d17c5-f825-748a-a41d-ec0e6975db8f	7	0	3	1	24	0	\N	0	\N
\.


--
-- Data for Name: rates; Type: TABLE DATA; Schema: public; Owner: -
--

COPY public.rates (worker, job, samples, core_us) FROM stdin;
019d17c6-1ba9-71ea-9a13-5be99bf58148	019d17c5-f825-748a-a41d-ec0e6975db8f	55296	347000
019d17c6-bbde-747b-81dd-3d5ffcd0c325	019d17c5-f825-748a-a41d-ec0e6975db8f	4096	73000
019d17c4-6c5a-777e-ad3e-77e7222bdc3d	019d17c4-49c1-7136-947c-6a5bae78b9d0	15360	15000
019d17c5-8768-7468-9394-44840874afce	019d17c5-64fd-710f-acab-d07d3d2399f5	208896	5895000
019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	019d17c5-a6d1-7710-ba46-f7d255ad87f8	215040	6467000
019d17c5-8768-7468-9394-44840874afce	019d17c5-a209-70ce-8f72-75972451a5ac	48000	386000
019d17c5-8768-7468-9394-44840874afce	019d17c5-a6d1-7710-ba46-f7d255ad87f8	61440	1036000
019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	019d17c5-ae46-75e9-8059-13ef54248271	149504	2955000
\.


--
-- Data for Name: rounds; Type: TABLE DATA; Schema: public; Owner: -
--

COPY public.rounds (job, frame, round, passes, samples_per_pixel, core_ms, wall_ms, recorded_ms, mse, corrected_mse, rel_mse, psnr, estimated_mse, flip) FROM stdin;
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	0	1	4	3	517	1795820242642	\N	\N	\N	\N	\N	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	1	2	8	6	577	1795820242704	\N	\N	\N	\N	\N	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	2	4	16	10	636	1795820242756	\N	\N	\N	\N	\N	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	3	8	32	15	685	1795820242796	\N	\N	\N	\N	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	0	1	4	57	343	1795820320565	\N	\N	\N	\N	\N	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	1	2	8	96	412	1795820320937	\N	\N	\N	\N	\N	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	2	4	16	127	546	1795820321051	\N	\N	\N	\N	\N	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	3	8	32	287	651	1795820321140	\N	\N	\N	\N	5.801614826454686e-05	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	4	16	64	722	1145	1795820321171	\N	\N	\N	\N	2.60133426053611e-05	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	5	32	128	1681	2131	1795820321281	\N	\N	\N	\N	1.1644528438178672e-05	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	6	48	192	2688	3174	1795820321311	\N	\N	\N	\N	7.82307831008513e-06	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	7	64	256	3652	4192	1795820321453	\N	\N	\N	\N	6.4754109043347724e-06	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	8	80	320	4374	4992	1795820321458	\N	\N	\N	\N	4.8518271209883e-06	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	9	96	384	5221	5891	1795820321466	\N	\N	\N	\N	3.951872130157307e-06	\N
019d17c5-a209-70ce-8f72-75972451a5ac	0	0	1	4	14	211	1795820321520	\N	\N	\N	\N	\N	\N
019d17c5-a209-70ce-8f72-75972451a5ac	0	1	2	8	43	330	1795820321679	\N	\N	\N	\N	\N	\N
019d17c5-a209-70ce-8f72-75972451a5ac	0	2	4	16	72	514	1795820321854	\N	\N	\N	\N	\N	\N
019d17c5-a209-70ce-8f72-75972451a5ac	0	3	8	32	124	652	1795820321961	\N	\N	\N	\N	5.801614826454686e-05	\N
019d17c5-a209-70ce-8f72-75972451a5ac	0	4	16	64	244	749	1795820322134	\N	\N	\N	\N	2.60133426053611e-05	\N
019d17c5-a209-70ce-8f72-75972451a5ac	0	5	25	100	386	1067	1795820322378	\N	\N	\N	\N	1.5948561611370206e-05	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	0	1	4	82	326	1795820322938	\N	\N	\N	\N	\N	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	1	2	8	116	473	1795820323040	\N	\N	\N	\N	\N	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	2	4	16	168	596	1795820323235	\N	\N	\N	\N	\N	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	3	8	32	274	721	1795820323296	\N	\N	\N	\N	2.1781207224949054e-05	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	4	16	64	559	920	1795820323567	\N	\N	\N	\N	1.28873373899008e-05	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	5	32	128	1036	1450	1795820324180	\N	\N	\N	\N	7.114972182807318e-06	\N
019d17c5-ae46-75e9-8059-13ef54248271	0	0	1	4	51	295	1795820339646	\N	\N	\N	\N	\N	\N
019d17c5-ae46-75e9-8059-13ef54248271	0	1	2	8	240	903	1795820339791	\N	\N	\N	\N	\N	\N
019d17c5-ae46-75e9-8059-13ef54248271	0	2	4	16	270	972	1795820340009	\N	\N	\N	\N	\N	\N
019d17c5-ae46-75e9-8059-13ef54248271	0	3	8	32	327	994	1795820340221	\N	\N	\N	\N	5.801614826454686e-05	\N
019d17c5-ae46-75e9-8059-13ef54248271	0	4	16	64	474	8059	1795820340390	\N	\N	\N	\N	2.6195422718889483e-05	\N
019d17c5-ae46-75e9-8059-13ef54248271	0	5	32	128	1256	9408	1795820341827	\N	\N	\N	\N	1.1831320233389345e-05	\N
019d17c5-ae46-75e9-8059-13ef54248271	0	6	48	192	1905	9616	1795820342012	\N	\N	\N	\N	7.921797493201862e-06	\N
019d17c5-ae46-75e9-8059-13ef54248271	0	7	64	256	2317	10689	1795820343122	\N	\N	\N	\N	6.539755145485234e-06	\N
019d17c5-f825-748a-a41d-ec0e6975db8f	0	0	1	4	14	178	1795820352679	0.00395365748773909	0.0039377089261277195	0.20502796660972322	27.58449107904464	\N	0.04940351925473341
019d17c5-f825-748a-a41d-ec0e6975db8f	0	1	2	8	22	226	1795820352849	0.0015456240133939357	0.0015296754517825654	0.09045148390526224	31.663442943357513	\N	0.04030912320612333
019d17c5-f825-748a-a41d-ec0e6975db8f	0	2	4	16	37	328	1795820352908	0.0005526446495549289	0.0005366960879435586	0.017747963739520423	36.130021810770145	\N	0.021937684580581065
019d17c5-f825-748a-a41d-ec0e6975db8f	0	3	8	32	76	427	1795820353026	0.00037151596963502656	0.00035556740802365636	0.012807375223703963	37.8547066415065	0.0001580591451971163	0.017193545284096397
019d17c5-f825-748a-a41d-ec0e6975db8f	0	4	16	64	143	494	1795820353116	0.00021497471486653673	0.00019902615325516652	0.0064600152247379136	40.23060769230051	0.0001689965355063921	0.014814450358572727
\.


--
-- Data for Name: sequences; Type: TABLE DATA; Schema: public; Owner: -
--

COPY public.sequences (name, value) FROM stdin;
event	55
\.


--
-- Data for Name: tile_shares; Type: TABLE DATA; Schema: public; Owner: -
--

COPY public.tile_shares (job, frame, tile, share) FROM stdin;
019d17c5-ae46-75e9-8059-13ef54248271	0	0	65536
019d17c5-ae46-75e9-8059-13ef54248271	0	1	48916
019d17c5-ae46-75e9-8059-13ef54248271	0	2	48916
019d17c5-ae46-75e9-8059-13ef54248271	0	3	48916
\.


--
-- Data for Name: waves; Type: TABLE DATA; Schema: public; Owner: -
--

COPY public.waves (job, frame, round, end_pass, outstanding, core_ms, completed_ms) FROM stdin;
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	4	16	32	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	5	32	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	6	48	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	7	64	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	8	80	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	9	96	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	10	112	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	11	128	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	12	144	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	13	160	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	14	176	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	15	192	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	16	208	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	17	224	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	18	240	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	19	256	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	20	272	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	21	288	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	22	304	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	23	320	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	24	336	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	25	352	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	26	368	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	27	384	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	28	400	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	29	416	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	30	432	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	31	448	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	32	464	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	33	480	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	34	496	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	35	512	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	36	528	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	37	544	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	38	560	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	39	576	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	40	592	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	41	608	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	42	624	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	43	640	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	44	656	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	45	672	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	46	688	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	47	704	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	48	720	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	49	736	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	50	752	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	51	768	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	52	784	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	53	800	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	54	816	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	55	832	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	56	848	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	57	864	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	58	880	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	59	896	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	60	912	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	61	928	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	62	944	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	63	960	64	0	\N
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	0	1	0	3	1795820242582
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	2	4	0	4	1795820242701
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	1	2	0	3	1795820242642
019d17c4-49c1-7136-947c-6a5bae78b9d0	0	3	8	0	5	1795820242750
019d17c5-64fd-710f-acab-d07d3d2399f5	0	10	112	32	674	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	1	2	0	39	1795820314890
019d17c5-64fd-710f-acab-d07d3d2399f5	0	3	8	0	160	1795820315129
019d17c5-64fd-710f-acab-d07d3d2399f5	0	4	16	0	435	1795820315623
019d17c5-64fd-710f-acab-d07d3d2399f5	0	5	32	0	959	1795820316609
019d17c5-64fd-710f-acab-d07d3d2399f5	0	6	48	0	1007	1795820317652
019d17c5-64fd-710f-acab-d07d3d2399f5	0	7	64	0	964	1795820318670
019d17c5-64fd-710f-acab-d07d3d2399f5	0	8	80	0	722	1795820319470
019d17c5-64fd-710f-acab-d07d3d2399f5	0	9	96	0	847	1795820320369
019d17c5-64fd-710f-acab-d07d3d2399f5	0	11	128	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	12	144	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	13	160	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	14	176	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	15	192	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	16	208	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	17	224	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	18	240	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	19	256	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	20	272	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	21	288	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	22	304	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	23	320	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	24	336	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	25	352	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	26	368	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	27	384	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	28	400	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	29	416	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	30	432	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	31	448	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	32	464	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	33	480	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	34	496	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	35	512	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	36	528	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	37	544	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	38	560	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	39	576	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	40	592	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	41	608	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	42	624	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	43	640	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	44	656	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	45	672	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	46	688	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	47	704	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	48	720	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	49	736	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	50	752	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	51	768	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	52	784	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	53	800	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	54	816	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	55	832	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	56	848	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	57	864	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	58	880	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	59	896	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	60	912	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	61	928	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	62	944	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	63	960	64	0	\N
019d17c5-64fd-710f-acab-d07d3d2399f5	0	0	1	0	57	1795820314821
019d17c5-64fd-710f-acab-d07d3d2399f5	0	2	4	0	31	1795820315024
019d17c5-a209-70ce-8f72-75972451a5ac	0	5	25	0	142	1795820322370
019d17c5-a209-70ce-8f72-75972451a5ac	0	0	1	0	14	1795820321514
019d17c5-a209-70ce-8f72-75972451a5ac	0	3	8	0	52	1795820321955
019d17c5-a209-70ce-8f72-75972451a5ac	0	1	2	0	29	1795820321633
019d17c5-a209-70ce-8f72-75972451a5ac	0	2	4	0	29	1795820321817
019d17c5-a209-70ce-8f72-75972451a5ac	0	4	16	0	120	1795820322052
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	6	48	32	23	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	0	1	0	82	1795820322842
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	1	2	0	34	1795820322989
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	2	4	0	52	1795820323112
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	3	8	0	106	1795820323237
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	4	16	0	285	1795820323436
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	5	32	0	477	1795820323966
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	8	80	0	435	1795820334663
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	9	96	0	673	1795820335390
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	10	112	0	1054	1795820336471
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	11	128	0	1132	1795820337646
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	14	176	64	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	15	192	64	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	16	208	64	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	17	224	64	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	18	240	64	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	19	256	64	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	20	272	64	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	21	288	64	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	22	300	48	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	0	0	1	0	51	1795820332607
019d17c5-ae46-75e9-8059-13ef54248271	0	7	64	0	412	1795820343001
019d17c5-ae46-75e9-8059-13ef54248271	0	8	80	12	638	\N
019d17c5-f825-748a-a41d-ec0e6975db8f	0	6	48	64	0	\N
019d17c5-f825-748a-a41d-ec0e6975db8f	0	7	50	8	0	\N
019d17c5-f825-748a-a41d-ec0e6975db8f	0	0	1	0	14	1795820352625
019d17c5-f825-748a-a41d-ec0e6975db8f	0	1	2	0	8	1795820352673
019d17c5-ae46-75e9-8059-13ef54248271	0	1	2	0	189	1795820333215
019d17c5-f825-748a-a41d-ec0e6975db8f	0	2	4	0	15	1795820352775
019d17c5-ae46-75e9-8059-13ef54248271	0	2	4	0	30	1795820333284
019d17c5-ae46-75e9-8059-13ef54248271	0	3	8	0	57	1795820333306
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	7	64	0	774	1795820334245
019d17c5-f825-748a-a41d-ec0e6975db8f	0	3	8	0	39	1795820352874
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	12	144	0	1377	1795820339102
019d17c5-ae46-75e9-8059-13ef54248271	0	9	96	52	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	0	10	112	52	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	0	11	128	52	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	0	12	144	52	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	0	13	160	52	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	0	14	176	52	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	0	15	192	52	0	\N
019d17c5-ae46-75e9-8059-13ef54248271	0	16	200	32	0	\N
019d17c5-a6d1-7710-ba46-f7d255ad87f8	0	13	160	32	999	\N
019d17c5-ae46-75e9-8059-13ef54248271	0	4	16	0	147	1795820340371
019d17c5-f825-748a-a41d-ec0e6975db8f	0	4	16	0	67	1795820352941
019d17c5-f825-748a-a41d-ec0e6975db8f	0	5	32	16	277	\N
019d17c5-ae46-75e9-8059-13ef54248271	0	5	32	0	782	1795820341720
019d17c5-ae46-75e9-8059-13ef54248271	0	6	48	0	649	1795820341928
\.


--
-- Data for Name: workers; Type: TABLE DATA; Schema: public; Owner: -
--

COPY public.workers (id, name, cores, build, probe_digest, registered_ms, seen_ms, accepted_nodes, refused_partials, failures_in_a_row, failed_ms, samples, core_ms, quarantine) FROM stdin;
019d17c6-1ba9-71ea-9a13-5be99bf58148	south	1	0.1.0+1fef4d5d9f4b	1a1ae608dbcbce6b76755c004e9490a2d87570c1cb16ca940f40376526d8ab1d	1795820352426	1795820353121	22	0	0	0	55296	347	\N
019d17c4-eb45-76ab-b9a2-bf43e16da1b3	out of memory 5	1	by hand	1a1ae608dbcbce6b76755c004e9490a2d87570c1cb16ca940f40376526d8ab1d	1795820274494	1795820274516	0	0	1	1795820274516	0	0	\N
019d17c5-01a8-75ec-bef8-fcee3aa961e4	out of memory 6	1	by hand	1a1ae608dbcbce6b76755c004e9490a2d87570c1cb16ca940f40376526d8ab1d	1795820280232	1795820280254	0	0	1	1795820280254	0	0	\N
019d17c6-9849-736b-98d5-939999e65bd8	asleep	1	by hand	1a1ae608dbcbce6b76755c004e9490a2d87570c1cb16ca940f40376526d8ab1d	1795820384322	1795820384351	0	0	0	0	0	0	\N
019d17c5-15ce-71c0-a92b-eda1a6190d51	out of memory 7	1	by hand	1a1ae608dbcbce6b76755c004e9490a2d87570c1cb16ca940f40376526d8ab1d	1795820285390	1795820285405	0	0	1	1795820285405	0	0	\N
019d17c5-2fd1-767a-af51-9cff9c850091	out of memory 8	1	by hand	1a1ae608dbcbce6b76755c004e9490a2d87570c1cb16ca940f40376526d8ab1d	1795820292049	1795820292069	0	0	1	1795820292069	0	0	\N
019d17c5-4939-75ce-91ef-25c57790eebf	out of memory 9	1	by hand	1a1ae608dbcbce6b76755c004e9490a2d87570c1cb16ca940f40376526d8ab1d	1795820298554	1795820298571	0	0	1	1795820298571	0	0	\N
019d17c4-6c5a-777e-ad3e-77e7222bdc3d	west	1	0.1.0+1fef4d5d9f4b	1a1ae608dbcbce6b76755c004e9490a2d87570c1cb16ca940f40376526d8ab1d	1795820242010	1795820242750	16	0	0	0	15360	15	\N
019d17c5-63f8-7423-89f0-bf626cd3fcbc	out of memory 10	1	by hand	1a1ae608dbcbce6b76755c004e9490a2d87570c1cb16ca940f40376526d8ab1d	1795820305386	1795820305426	0	0	1	1795820305426	0	0	\N
019d17c4-8ab6-758a-97c3-b4842f6b8afb	out of memory 1	1	by hand	1a1ae608dbcbce6b76755c004e9490a2d87570c1cb16ca940f40376526d8ab1d	1795820249775	1795820249838	0	0	1	1795820249838	0	0	\N
019d17c4-a2fd-7534-a94c-1edc2dd563cb	out of memory 2	1	by hand	1a1ae608dbcbce6b76755c004e9490a2d87570c1cb16ca940f40376526d8ab1d	1795820255996	1795820256004	0	0	1	1795820256004	0	0	\N
019d17c6-bbde-747b-81dd-3d5ffcd0c325	east	1	0.1.0+1fef4d5d9f4b	1a1ae608dbcbce6b76755c004e9490a2d87570c1cb16ca940f40376526d8ab1d	1795820393439	1795820393715	1	0	0	0	4096	73	\N
019d17c4-bd34-726a-aed0-882ac4b75d13	out of memory 3	1	by hand	1a1ae608dbcbce6b76755c004e9490a2d87570c1cb16ca940f40376526d8ab1d	1795820262708	1795820262752	0	0	1	1795820262752	0	0	\N
019d17c5-ccf5-72b3-8c2f-84fc45fb5d30	south	1	0.1.0+1fef4d5d9f4b	1a1ae608dbcbce6b76755c004e9490a2d87570c1cb16ca940f40376526d8ab1d	1795820332277	1795820343156	106	0	0	0	364544	9422	\N
019d17c4-d5ad-773f-bd03-c643318f466e	out of memory 4	1	by hand	1a1ae608dbcbce6b76755c004e9490a2d87570c1cb16ca940f40376526d8ab1d	1795820268973	1795820269002	0	0	1	1795820269002	0	0	\N
019d17c5-8768-7468-9394-44840874afce	north	1	0.1.0+1fef4d5d9f4b	1a1ae608dbcbce6b76755c004e9490a2d87570c1cb16ca940f40376526d8ab1d	1795820314464	1795820323966	94	0	0	0	318336	7317	\N
\.


--
-- Name: _sqlx_migrations _sqlx_migrations_pkey; Type: CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public._sqlx_migrations
    ADD CONSTRAINT _sqlx_migrations_pkey PRIMARY KEY (version);


--
-- Name: assets assets_pkey; Type: CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.assets
    ADD CONSTRAINT assets_pkey PRIMARY KEY (hash);


--
-- Name: checks checks_job_frame_tile_level_idx_key; Type: CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.checks
    ADD CONSTRAINT checks_job_frame_tile_level_idx_key UNIQUE (job, frame, tile, level, idx);


--
-- Name: checks checks_pkey; Type: CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.checks
    ADD CONSTRAINT checks_pkey PRIMARY KEY (id);


--
-- Name: events events_pkey; Type: CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.events
    ADD CONSTRAINT events_pkey PRIMARY KEY (id);


--
-- Name: farm farm_pkey; Type: CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.farm
    ADD CONSTRAINT farm_pkey PRIMARY KEY (single);


--
-- Name: job_assets job_assets_pkey; Type: CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.job_assets
    ADD CONSTRAINT job_assets_pkey PRIMARY KEY (job, path);


--
-- Name: jobs jobs_pkey; Type: CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.jobs
    ADD CONSTRAINT jobs_pkey PRIMARY KEY (id);


--
-- Name: keepers keepers_pkey; Type: CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.keepers
    ADD CONSTRAINT keepers_pkey PRIMARY KEY (job);


--
-- Name: leases leases_pkey; Type: CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.leases
    ADD CONSTRAINT leases_pkey PRIMARY KEY (id);


--
-- Name: leases leases_token_key; Type: CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.leases
    ADD CONSTRAINT leases_token_key UNIQUE (token);


--
-- Name: opinions opinions_pkey; Type: CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.opinions
    ADD CONSTRAINT opinions_pkey PRIMARY KEY (check_id, worker);


--
-- Name: pending pending_pkey; Type: CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.pending
    ADD CONSTRAINT pending_pkey PRIMARY KEY (job, frame, tile, level, idx);


--
-- Name: nodes placed_nodes_pkey; Type: CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.nodes
    ADD CONSTRAINT placed_nodes_pkey PRIMARY KEY (job, frame, tile, level, idx);


--
-- Name: rates recent_rates_pkey; Type: CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.rates
    ADD CONSTRAINT recent_rates_pkey PRIMARY KEY (worker, job);


--
-- Name: rounds rounds_pkey; Type: CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.rounds
    ADD CONSTRAINT rounds_pkey PRIMARY KEY (job, frame, round);


--
-- Name: sequences sequences_pkey; Type: CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.sequences
    ADD CONSTRAINT sequences_pkey PRIMARY KEY (name);


--
-- Name: tile_shares tile_shares_pkey; Type: CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.tile_shares
    ADD CONSTRAINT tile_shares_pkey PRIMARY KEY (job, frame, tile);


--
-- Name: waves waves_pkey; Type: CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.waves
    ADD CONSTRAINT waves_pkey PRIMARY KEY (job, frame, round);


--
-- Name: workers workers_pkey; Type: CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.workers
    ADD CONSTRAINT workers_pkey PRIMARY KEY (id);


--
-- Name: checks_by_lease; Type: INDEX; Schema: public; Owner: -
--

CREATE INDEX checks_by_lease ON public.checks USING btree (lease) WHERE (lease IS NOT NULL);


--
-- Name: checks_by_second_lease; Type: INDEX; Schema: public; Owner: -
--

CREATE INDEX checks_by_second_lease ON public.checks USING btree (second_lease) WHERE (second_lease IS NOT NULL);


--
-- Name: jobs_by_state; Type: INDEX; Schema: public; Owner: -
--

CREATE INDEX jobs_by_state ON public.jobs USING btree (state, priority, created_ms, id);


--
-- Name: leases_by_worker; Type: INDEX; Schema: public; Owner: -
--

CREATE INDEX leases_by_worker ON public.leases USING btree (worker, state);


--
-- Name: leases_due; Type: INDEX; Schema: public; Owner: -
--

CREATE INDEX leases_due ON public.leases USING btree (job, due_ms) WHERE (state = 'active'::text);


--
-- Name: leases_ended; Type: INDEX; Schema: public; Owner: -
--

CREATE INDEX leases_ended ON public.leases USING btree (deadline_ms) WHERE (state <> 'active'::text);


--
-- Name: leases_held; Type: INDEX; Schema: public; Owner: -
--

CREATE INDEX leases_held ON public.leases USING btree (granted_ms, token) WHERE (state = 'active'::text);


--
-- Name: leases_of_jobs; Type: INDEX; Schema: public; Owner: -
--

CREATE INDEX leases_of_jobs ON public.leases USING btree (job, worker) WHERE (state = 'active'::text);


--
-- Name: leases_running_out; Type: INDEX; Schema: public; Owner: -
--

CREATE INDEX leases_running_out ON public.leases USING btree (deadline_ms) WHERE (state = 'active'::text);


--
-- Name: nodes_by_blob; Type: INDEX; Schema: public; Owner: -
--

CREATE INDEX nodes_by_blob ON public.nodes USING btree (blob);


--
-- Name: nodes_by_pass; Type: INDEX; Schema: public; Owner: -
--

CREATE INDEX nodes_by_pass ON public.nodes USING btree (job, frame, tile, first_pass);


--
-- Name: pending_by_lease; Type: INDEX; Schema: public; Owner: -
--

CREATE INDEX pending_by_lease ON public.pending USING btree (lease) WHERE (lease IS NOT NULL);


--
-- Name: pending_free; Type: INDEX; Schema: public; Owner: -
--

CREATE INDEX pending_free ON public.pending USING btree (job, round, frame, tile, idx) WHERE (lease IS NULL);


--
-- Name: waves_by_round; Type: INDEX; Schema: public; Owner: -
--

CREATE INDEX waves_by_round ON public.waves USING btree (job, round);


--
-- Name: waves_incomplete; Type: INDEX; Schema: public; Owner: -
--

CREATE INDEX waves_incomplete ON public.waves USING btree (job, round) WHERE (completed_ms IS NULL);


--
-- Name: workers_by_name; Type: INDEX; Schema: public; Owner: -
--

CREATE INDEX workers_by_name ON public.workers USING btree (name);


--
-- Name: checks checks_job_fkey; Type: FK CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.checks
    ADD CONSTRAINT checks_job_fkey FOREIGN KEY (job) REFERENCES public.jobs(id);


--
-- Name: checks checks_lease_fkey; Type: FK CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.checks
    ADD CONSTRAINT checks_lease_fkey FOREIGN KEY (lease) REFERENCES public.leases(id);


--
-- Name: checks checks_second_lease_fkey; Type: FK CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.checks
    ADD CONSTRAINT checks_second_lease_fkey FOREIGN KEY (second_lease) REFERENCES public.leases(id);


--
-- Name: events events_job_fkey; Type: FK CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.events
    ADD CONSTRAINT events_job_fkey FOREIGN KEY (job) REFERENCES public.jobs(id);


--
-- Name: job_assets job_assets_hash_fkey; Type: FK CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.job_assets
    ADD CONSTRAINT job_assets_hash_fkey FOREIGN KEY (hash) REFERENCES public.assets(hash);


--
-- Name: job_assets job_assets_job_fkey; Type: FK CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.job_assets
    ADD CONSTRAINT job_assets_job_fkey FOREIGN KEY (job) REFERENCES public.jobs(id);


--
-- Name: jobs jobs_reference_fkey; Type: FK CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.jobs
    ADD CONSTRAINT jobs_reference_fkey FOREIGN KEY (reference) REFERENCES public.assets(hash);


--
-- Name: keepers keepers_job_fkey; Type: FK CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.keepers
    ADD CONSTRAINT keepers_job_fkey FOREIGN KEY (job) REFERENCES public.jobs(id);


--
-- Name: leases leases_job_fkey; Type: FK CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.leases
    ADD CONSTRAINT leases_job_fkey FOREIGN KEY (job) REFERENCES public.jobs(id);


--
-- Name: leases leases_worker_fkey; Type: FK CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.leases
    ADD CONSTRAINT leases_worker_fkey FOREIGN KEY (worker) REFERENCES public.workers(id);


--
-- Name: opinions opinions_check_id_fkey; Type: FK CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.opinions
    ADD CONSTRAINT opinions_check_id_fkey FOREIGN KEY (check_id) REFERENCES public.checks(id) ON DELETE CASCADE;


--
-- Name: opinions opinions_worker_fkey; Type: FK CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.opinions
    ADD CONSTRAINT opinions_worker_fkey FOREIGN KEY (worker) REFERENCES public.workers(id);


--
-- Name: pending pending_job_fkey; Type: FK CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.pending
    ADD CONSTRAINT pending_job_fkey FOREIGN KEY (job) REFERENCES public.jobs(id);


--
-- Name: pending pending_lease_fkey; Type: FK CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.pending
    ADD CONSTRAINT pending_lease_fkey FOREIGN KEY (lease) REFERENCES public.leases(id);


--
-- Name: nodes placed_nodes_job_fkey; Type: FK CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.nodes
    ADD CONSTRAINT placed_nodes_job_fkey FOREIGN KEY (job) REFERENCES public.jobs(id);


--
-- Name: rates recent_rates_job_fkey; Type: FK CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.rates
    ADD CONSTRAINT recent_rates_job_fkey FOREIGN KEY (job) REFERENCES public.jobs(id);


--
-- Name: rates recent_rates_worker_fkey; Type: FK CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.rates
    ADD CONSTRAINT recent_rates_worker_fkey FOREIGN KEY (worker) REFERENCES public.workers(id);


--
-- Name: rounds rounds_job_fkey; Type: FK CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.rounds
    ADD CONSTRAINT rounds_job_fkey FOREIGN KEY (job) REFERENCES public.jobs(id);


--
-- Name: tile_shares tile_shares_job_fkey; Type: FK CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.tile_shares
    ADD CONSTRAINT tile_shares_job_fkey FOREIGN KEY (job) REFERENCES public.jobs(id);


--
-- Name: waves waves_job_fkey; Type: FK CONSTRAINT; Schema: public; Owner: -
--

ALTER TABLE ONLY public.waves
    ADD CONSTRAINT waves_job_fkey FOREIGN KEY (job) REFERENCES public.jobs(id);


--
-- PostgreSQL database dump complete
--


