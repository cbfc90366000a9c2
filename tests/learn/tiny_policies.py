"""Makes checkpoints of tiny policies with random weights, as LeRobot saves them; nothing is downloaded."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import torch
from lerobot.configs.types import FeatureType, PolicyFeature

JOINTS = 6


def features(cameras: tuple[str, ...], height: int, width: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """Inputs and outputs of a policy of an arm."""
    seen = {"observation.state": PolicyFeature(FeatureType.STATE, (JOINTS,))}
    for name in cameras:
        seen[f"observation.images.{name}"] = PolicyFeature(FeatureType.VISUAL, (3, height, width))
    return seen, {"action": PolicyFeature(FeatureType.ACTION, (JOINTS,))}


def statistics(described: dict[str, Any], *, radians: bool = False) -> dict[str, dict[str, Any]]:
    """Statistics of a data set in LeRobot's units, or in radians."""
    draw, scale = np.random.default_rng(0), 0.02 if radians else 1.0
    found = {}
    for key, feature in described.items():
        if feature.type is FeatureType.VISUAL:
            values = {"mean": np.full((3, 1, 1), 0.5), "std": np.full((3, 1, 1), 0.25)}
            values |= {"min": np.zeros((3, 1, 1)), "max": np.ones((3, 1, 1))}
        else:
            mean = scale * draw.uniform(-20, 20, feature.shape)
            values = {"mean": mean, "std": np.full(feature.shape, 30.0 * scale)}
            values |= {"min": mean - 60 * scale, "max": mean + 60 * scale}
        found[key] = {name: torch.tensor(value, dtype=torch.float32) for name, value in values.items()}
    return found


def save(folder: Path, policy: Any, before: Any, after: Any) -> None:
    """Writes a checkpoint."""
    for part in (policy, before, after):
        part.save_pretrained(folder)


def make_act(
    folder: Path,
    cameras: tuple[str, ...] = ("top", "wrist"),
    *,
    height: int = 96,
    width: int = 96,
    chunk: int = 20,
    radians: bool = False,
) -> tuple[Any, Any, Any]:
    """A tiny ACT, saved into a folder: policy, pre- and post-processor."""
    from lerobot.policies.act.configuration_act import ACTConfig
    from lerobot.policies.act.modeling_act import ACTPolicy
    from lerobot.policies.act.processor_act import make_act_pre_post_processors

    torch.manual_seed(0)
    seen, done = features(cameras, height, width)
    config = ACTConfig(
        input_features=seen,
        output_features=done,
        chunk_size=chunk,
        n_action_steps=chunk,
        dim_model=64,
        n_heads=4,
        dim_feedforward=128,
        n_encoder_layers=2,
        latent_dim=8,
        n_vae_encoder_layers=1,
        pretrained_backbone_weights=None,
        device="cpu",
        push_to_hub=False,
    )
    policy = ACTPolicy(config)
    policy.eval()
    before, after = make_act_pre_post_processors(
        config, dataset_stats=statistics({**seen, **done}, radians=radians)
    )
    save(folder, policy, before, after)
    return policy, before, after


def make_language_model(folder: Path, side: int) -> None:
    """Writes the description and the tokenizer of a tiny SmolVLM."""
    from tokenizers import Tokenizer, decoders, models, pre_tokenizers, trainers
    from transformers import (
        PreTrainedTokenizerFast,
        SmolVLMConfig,
        SmolVLMImageProcessor,
        SmolVLMProcessor,
        SmolVLMVideoProcessor,
    )

    special = [
        "<|endoftext|>",
        "<|im_start|>",
        "<|im_end|>",
        "<image>",
        "<fake_token_around_image>",
        "<global-img>",
        "<end_of_utterance>",
    ]
    tokens = Tokenizer(models.BPE())
    tokens.pre_tokenizer = pre_tokenizers.ByteLevel(add_prefix_space=False)
    tokens.decoder = decoders.ByteLevel()
    trainer = trainers.BpeTrainer(
        vocab_size=512,
        special_tokens=special,
        initial_alphabet=pre_tokenizers.ByteLevel.alphabet(),
        show_progress=False,
    )
    tokens.train_from_iterator(["put the red cube into the box\n", "reach the cube\n"] * 20, trainer)
    tokenizer = PreTrainedTokenizerFast(
        tokenizer_object=tokens,
        bos_token="<|im_start|>",
        eos_token="<end_of_utterance>",
        unk_token="<|endoftext|>",
        pad_token="<|im_end|>",
        additional_special_tokens=["<fake_token_around_image>", "<image>", "<global-img>"],
        model_max_length=2048,
        extra_special_tokens={
            "image_token": "<image>",
            "fake_image_token": "<fake_token_around_image>",
            "global_image_token": "<global-img>",
            "end_of_utterance_token": "<end_of_utterance>",
        },
    )
    sizes = {
        "size": {"longest_edge": side},
        "max_image_size": {"longest_edge": side},
        "do_image_splitting": False,
    }
    video = {"max_frames": 4, "fps": 1, "video_size": {"longest_edge": side}}
    SmolVLMProcessor(
        SmolVLMImageProcessor(**sizes),
        tokenizer,
        SmolVLMVideoProcessor(**sizes, video_sampling=video),
        image_seq_len=(side // 16) ** 2 // 16,
        chat_template="{% for m in messages %}{{m['role']}}: {{m['content']}}\n{% endfor %}",
    ).save_pretrained(folder)
    common = {"hidden_size": 64, "intermediate_size": 128, "num_hidden_layers": 2, "num_attention_heads": 4}
    config = SmolVLMConfig(
        image_token_id=tokenizer.convert_tokens_to_ids("<image>"),
        scale_factor=4,
        tie_word_embeddings=False,
        pad_token_id=tokenizer.pad_token_id,
        vision_config={**common, "image_size": side, "patch_size": 16},
        text_config={
            **common,
            "model_type": "llama",
            "vocab_size": len(tokenizer),
            "num_key_value_heads": 2,
            "head_dim": 16,
            "max_position_embeddings": 2048,
            "rms_norm_eps": 1e-5,
            "pad_token_id": tokenizer.pad_token_id,
            "bos_token_id": tokenizer.bos_token_id,
            "eos_token_id": tokenizer.eos_token_id,
        },
    )
    config.architectures = ["SmolVLMForConditionalGeneration"]
    config.save_pretrained(folder)


def make_smolvla(
    folder: Path, cameras: tuple[str, ...] = ("top", "wrist"), *, chunk: int = 10, side: int = 128
) -> tuple[Any, Any, Any]:
    """A tiny SmolVLA, saved with its language model in ``vlm``: policy, pre- and post-processor."""
    from lerobot.policies.smolvla.configuration_smolvla import SmolVLAConfig
    from lerobot.policies.smolvla.modeling_smolvla import SmolVLAPolicy
    from lerobot.policies.smolvla.processor_smolvla import make_smolvla_pre_post_processors

    torch.manual_seed(0)
    make_language_model(folder / "vlm", side)
    seen, done = features(cameras, 96, 96)
    config = SmolVLAConfig(
        input_features=seen,
        output_features=done,
        chunk_size=chunk,
        n_action_steps=chunk,
        vlm_model_name=str(folder / "vlm"),
        load_vlm_weights=False,
        resize_imgs_with_padding=(side, side),
        num_vlm_layers=2,
        max_state_dim=8,
        max_action_dim=8,
        num_steps=4,
        device="cpu",
        push_to_hub=False,
        expert_width_multiplier=0.5,
    )
    policy = SmolVLAPolicy(config)
    policy.eval()
    before, after = make_smolvla_pre_post_processors(config, dataset_stats=statistics({**seen, **done}))
    save(folder, policy, before, after)
    written = json.loads((folder / "config.json").read_text())
    (folder / "config.json").write_text(json.dumps(written | {"vlm_model_name": "vlm"}, indent=4))
    return policy, before, after


def make_diffusion(folder: Path, *, radians: bool = False) -> tuple[Any, Any, Any]:
    """A tiny Diffusion policy, which looks back one step, saved into a folder."""
    from lerobot.policies.diffusion.configuration_diffusion import DiffusionConfig
    from lerobot.policies.diffusion.modeling_diffusion import DiffusionPolicy
    from lerobot.policies.diffusion.processor_diffusion import make_diffusion_pre_post_processors

    torch.manual_seed(0)
    seen, done = features(("top", "wrist"), 96, 96)
    config = DiffusionConfig(
        input_features=seen,
        output_features=done,
        pretrained_backbone_weights=None,
        crop_shape=None,
        down_dims=(32, 64),
        diffusion_step_embed_dim=32,
        n_groups=8,
        horizon=8,
        n_action_steps=4,
        num_inference_steps=2,
        device="cpu",
        push_to_hub=False,
    )
    policy = DiffusionPolicy(config)
    policy.eval()
    parts = make_diffusion_pre_post_processors(
        config, dataset_stats=statistics({**seen, **done}, radians=radians)
    )
    save(folder, policy, *parts)
    return policy, *parts


def make_tdmpc(folder: Path) -> tuple[Any, Any, Any]:
    """A tiny TD-MPC, which knows its one camera as observation.image, saved into a folder."""
    from lerobot.policies.tdmpc.configuration_tdmpc import TDMPCConfig
    from lerobot.policies.tdmpc.modeling_tdmpc import TDMPCPolicy
    from lerobot.policies.tdmpc.processor_tdmpc import make_tdmpc_pre_post_processors

    torch.manual_seed(0)
    seen, done = features((), 0, 0)
    seen["observation.image"] = PolicyFeature(FeatureType.VISUAL, (3, 96, 96))
    config = TDMPCConfig(
        input_features=seen,
        output_features=done,
        latent_dim=16,
        image_encoder_hidden_dim=8,
        state_encoder_hidden_dim=32,
        mlp_dim=32,
        cem_iterations=2,
        n_gaussian_samples=32,
        n_pi_samples=8,
        n_elites=8,
        device="cpu",
        push_to_hub=False,
    )
    policy = TDMPCPolicy(config)
    policy.eval()
    parts = make_tdmpc_pre_post_processors(config, dataset_stats=statistics({**seen, **done}))
    save(folder, policy, *parts)
    return policy, *parts


def make_vqbet(folder: Path) -> tuple[Any, Any, Any]:
    """A tiny VQ-BeT, which looks back two steps, saved into a folder."""
    from lerobot.policies.vqbet.configuration_vqbet import VQBeTConfig
    from lerobot.policies.vqbet.modeling_vqbet import VQBeTPolicy
    from lerobot.policies.vqbet.processor_vqbet import make_vqbet_pre_post_processors

    torch.manual_seed(0)
    seen, done = features(("top",), 96, 96)
    config = VQBeTConfig(
        input_features=seen,
        output_features=done,
        n_obs_steps=3,
        action_chunk_size=4,
        crop_shape=None,
        pretrained_backbone_weights=None,
        spatial_softmax_num_keypoints=4,
        vqvae_embedding_dim=16,
        vqvae_enc_hidden_dim=16,
        gpt_block_size=32,
        gpt_input_dim=32,
        gpt_output_dim=32,
        gpt_n_layer=1,
        gpt_n_head=2,
        gpt_hidden_dim=32,
        device="cpu",
        push_to_hub=False,
    )
    policy = VQBeTPolicy(config)
    policy.vqbet.action_head.vqvae_model.discretized.fill_(True)  # as training does once its codes are there
    policy.eval()
    parts = make_vqbet_pre_post_processors(config, dataset_stats=statistics({**seen, **done}))
    save(folder, policy, *parts)
    return policy, *parts
